"use strict";
// Draws the maps of the page and the hits that the reader selects (drawing.js). All numbers come from #data.
(async () => {
  async function unpacked(id) {
    const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
    return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  }
  if (typeof DecompressionStream === "undefined") {
    document.querySelectorAll(".note").forEach((note) => { note.textContent = "The maps need a browser of 2023 or newer."; });
    return;
  }
  const data = JSON.parse(await unpacked("data"));
  const library = document.createElement("script");
  library.textContent = await unpacked("plotly");
  document.head.append(library);
  const { distance, drawMap, drawPictures, drawTrajectory, hitOf, number, hitLines } = hitMaps(data);
  const element = (name, result) => document.getElementById(`${name}-${result.index}`);
  const draw = (result) => drawMap(element("map", result), result, picker.value, result);

  function choose(result, hit) {
    result.chosen = hit;
    element("hit-text", result).textContent = hitLines(
      result, hit, data.variables.map(({ key }) => key),
    ).join("\n");
    const note = element("note", result);
    const nearestOf = (hits) => hits.reduce((a, b) => (distance(result, b, hit) < distance(result, a, hit) ? b : a));
    if (result.pictured.length) {
      const nearest = nearestOf(result.pictured), away = number(distance(result, nearest, hit));
      const place = result.uniform || nearest === hit ? " by finite elements" : `, the nearest by finite elements, ${away} mm away`;
      element("picture-note", result).textContent = `Sections of hit ${result.number[nearest]}${place}: `
        + "along the line of flight, in the plane in which the core turns.";
      drawPictures(element("pictures", result), result.pictures, result.number[nearest]);
    }
    if (result.replayed.length) {
      const nearest = nearestOf(result.replayed);
      note.textContent = nearest === hit ? `Trajectory of hit ${result.number[hit]}.`
        : `Hit ${result.number[hit]} has no trajectory in this report. Shown is hit ${result.number[nearest]}`
          + (result.uniform ? "." : `, the nearest that has one, ${number(distance(result, nearest, hit))} mm away.`);
      drawTrajectory([element("passage", result), element("flight", result)], result.trajectories[result.number[nearest]]);
    }
    return draw(result);
  }

  const picker = document.getElementById("variable");
  data.results.forEach((result, index) => {
    Object.assign(result, { index, chosen: null });
    const order = new Map(result.number.map((hit, place) => [String(hit), place]));
    result.replayed = Object.keys(result.trajectories).map((hit) => order.get(hit));
    result.pictured = Object.keys(result.pictures.hits ?? {}).map((hit) => result.number.indexOf(Number(hit)));
  });
  for (const result of data.results) {
    const first = result.first;
    const drawn = first === null ? draw(result) : choose(result, result.number.indexOf(first));
    drawn.then((place) => place.on("plotly_click", ({ points }) => {
      const point = points.find(({ curveNumber }) => curveNumber === 0);
      if (point) choose(result, hitOf(result, point));
    }));
  }
  picker.addEventListener("change", () => data.results.forEach(draw));
})();
