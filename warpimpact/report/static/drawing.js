"use strict";
// Draws maps of hits and views of a core, on a page that has Plotly. All numbers come from `data` (report/hit_data.py).
function hitMaps(data) {
  const config = { displaylogo: false, responsive: true, showSendToCloud: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  const STATUS = "status", MISSING = "#e6e6e6", FAILED = "#595959", CHOSEN = "#d55e00";
  // Of the page, which may be light or dark.
  const ink = getComputedStyle(document.body).color;
  const rule = { gridcolor: getComputedStyle(document.documentElement).getPropertyValue("--line") };
  const font = { family: "system-ui, sans-serif", size: 12, color: ink };
  const sheet = { font, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", modebar: { bgcolor: "rgba(0,0,0,0)" } };
  // Four digits; less than a thousandth of a unit is rounding.
  const number = (value) => {
    if (value === null) return "–";
    return String(Math.abs(value) < 1e-3 ? 0 : Number(value.toPrecision(4))).replace("-", "−");
  };
  const statusOf = (code) => data.statuses.find((status) => status.code === code);
  const shareOf = (result, hit) => result.columns[data.share]?.[hit] ?? null;
  const split = (label) => label.match(/^(.*) \[(.*)\]$/).slice(1);

  function hitLines(result, hit, keys) {
    const lines = data.variables.filter(({ key }) => keys.includes(key)).map(({ key, label }) => {
      const [name, unit] = split(label);
      return `${name}: ${number(result.columns[key][hit])}${unit === "°" ? "" : " "}${unit}`;
    });
    const place = result.uniform ? [] : [`y = ${number(result.y[hit])} mm, z = ${number(result.z[hit])} mm`];
    const share = shareOf(result, hit), often = share > 0 && share < 100 ? "most often " : "";
    return [`hit ${result.number[hit]}: ${often}${statusOf(result.status[hit]).label}`, ...place, ...lines];
  }

  // The label at the pointer for every hit, short enough for a phone.
  function hovers(result, variable) {
    const keys = data.variables.map(({ key }) => key).filter((key) => key === variable || data.main.includes(key));
    return result.number.map((_, hit) => hitLines(result, hit, keys).join("<br>"));
  }

  function valuesOf(result, variable) {
    if (variable !== STATUS) return result.columns[variable];
    return result.status.map((code) => data.statuses.findIndex((status) => status.code === code));
  }

  // One scale for all results makes maps comparable.
  function colours(variable) {
    if (variable === STATUS) {
      const count = data.statuses.length;
      const scale = data.statuses.flatMap(({ colour }, k) => [[k / count, colour], [(k + 1) / count, colour]]);
      const bar = { tickvals: data.statuses.map((_, k) => k), ticktext: data.statuses.map(({ label }) => label) };
      return { scale, low: -0.5, high: count - 0.5, bar };
    }
    const { signed, share, label } = data.variables.find(({ key }) => key === variable);
    if (share) {
      const scale = data.share_colours.map((colour, k, { length }) => [k / (length - 1), colour]);
      return { scale, low: 0, high: 100, bar: { title: { text: split(label)[1] } } };
    }
    let low = Infinity, high = -Infinity;
    for (const result of data.results) {
      for (const value of result.columns[variable]) {
        if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
      }
    }
    if (low > high) { low = 0; high = 1; }
    if (signed) { high = Math.max(Math.abs(low), Math.abs(high)); low = -high; }
    return { scale: signed ? "RdBu" : "Viridis", reversed: signed, low, high, bar: { title: { text: split(label)[1] } } };
  }

  function pixelTrace(result, values, texts, { scale, reversed, low, high, bar }) {
    const rows = result.nearest.length, columns = result.nearest[0].length;
    const [wide, tall] = result.period;
    const centres = (count, length) => Array.from({ length: count }, (_, k) => ((k + 0.5) / count - 0.5) * length);
    return {
      type: "heatmap", x: centres(columns, wide), y: centres(rows, tall),
      z: result.nearest.map((row) => row.map((hit) => values[hit])),
      text: result.nearest.map((row) => row.map((hit) => texts[hit])),
      hovertemplate: "%{text}<extra></extra>", hoverongaps: true,
      colorscale: scale, reversescale: reversed, zmin: low, zmax: high, colorbar: { thickness: 14, xpad: 5, ...bar },
    };
  }

  function pointTrace(result, values, texts, { scale, reversed, low, high, bar }) {
    const marker = {
      size: 9, line: { color: "black", width: 0.7 }, color: values.map((value) => (value === null ? NaN : value)),
      colorscale: scale, reversescale: reversed, cmin: low, cmax: high, showscale: true, colorbar: { thickness: 14, xpad: 5, ...bar },
    };
    return {
      type: "scatter", mode: "markers", x: result.y, y: result.z, marker, text: texts, showlegend: false,
      hovertemplate: "%{text}<extra></extra>",
    };
  }

  // Where the computation of the nearest hit failed.
  function failedTrace(result) {
    const failed = result.status.map((code) => (statusOf(code).failed ? 1 : null));
    if (!result.nearest || failed.every((one) => one === null)) return [];
    const trace = pixelTrace(result, failed, [], { scale: [[0, FAILED], [1, FAILED]], low: 0, high: 1 });
    return [{ ...trace, hoverinfo: "skip", hovertemplate: null, showscale: false }];
  }

  // Where the shots fly: an arrow with its angle, or words where they fly at the reader.
  function fireNotes(fire) {
    if (!fire) return [];
    const [along, up] = fire.along, corner = { xref: "x domain", yref: "y domain", x: 0.97, y: 0.04, font: { color: "black", size: 12 } };
    const text = { ...corner, text: fire.text, showarrow: false, xanchor: "right", yanchor: "bottom", bgcolor: "rgba(255,255,255,0.8)" };
    if (!along && !up) return [text];
    const head = { xshift: 20 * along - 25, yshift: 20 * up + 45, ax: -40 * along, ay: 40 * up };
    return [text, { ...corner, ...head, text: "", showarrow: true, arrowhead: 2, arrowwidth: 2, arrowcolor: "black" }];
  }

  const passive = { hoverinfo: "skip", showlegend: false };

  // `chosen` is a hit with a ring; `replayed` are hits with a dot. `tight` leaves out the names of the axes.
  function drawMap(place, result, variable, { chosen = null, replayed = [], tallest: most = 480, tight = false } = {}) {
    const values = valuesOf(result, variable), scale = colours(variable);
    const [y, z] = result.outline;
    const traces = [
      (result.nearest ? pixelTrace : pointTrace)(result, values, hovers(result, variable), scale),
      { ...passive, type: "scatter", mode: "lines", x: y, y: z, line: { color: "black", width: 3 } },
      { ...passive, type: "scatter", mode: "lines", x: y, y: z, line: { color: "white", width: 1.2 } },
      {
        ...passive, type: "scatter", mode: "markers", x: replayed.map((hit) => result.y[hit]),
        y: replayed.map((hit) => result.z[hit]),
        marker: { symbol: "circle", size: 6, color: "white", line: { color: "black", width: 1 } },
      },
      {
        ...passive, type: "scatter", mode: "markers", x: chosen === null ? [] : [result.y[chosen]],
        y: chosen === null ? [] : [result.z[chosen]],
        marker: { symbol: "circle-open", size: 16, color: CHOSEN, line: { width: 3 } },
      },
      ...[["black", 4], ["white", 1.5]].map(([color, width]) => ({
        ...passive, type: "scatter", mode: "markers", x: result.elements.map((hit) => result.y[hit]),
        y: result.elements.map((hit) => result.z[hit]),
        marker: { symbol: "circle-open", size: 9, color, line: { width } },
      })),
      ...failedTrace(result),
    ];
    // One scale of length for all maps: the widest fills its place, and the tallest stays on a screen.
    const spans = data.results.map(({ limits }) => limits.map(([low, high]) => high - low));
    const [widest, tallest] = [0, 1].map((axis) => Math.max(...spans.map((span) => span[axis])));
    const bar = 90, above = tight ? 8 : 30, below = tight ? 22 : 45, perMm = Math.min((place.clientWidth - 60 - bar) / widest, most / tallest);
    const [wide, tall] = spans[data.results.indexOf(result)];
    const layout = {
      ...sheet, margin: { l: 50, r: 10 + bar, t: above, b: below }, width: wide * perMm + 60 + bar,
      height: tall * perMm + above + below, autosize: false,
      plot_bgcolor: MISSING, annotations: fireNotes(result.fire), hoverlabel: { align: "left", bgcolor: "white", font: { color: "black" } },
      xaxis: {
        title: { text: tight ? "" : "hit y [mm]" }, range: result.limits[0], visible: !result.uniform,
        constrain: "domain", zeroline: false, showgrid: false,
      },
      yaxis: {
        title: { text: tight ? "" : "hit z [mm]" }, range: result.limits[1], visible: !result.uniform,
        constrain: "domain", zeroline: false, showgrid: false, scaleanchor: "x",
      },
    };
    return Plotly.react(place, traces, layout, { ...config, displayModeBar: tight ? false : "hover" });
  }

  function distance(result, one, other) {
    const along = (axis, period) => {
      const offset = result[axis][one] - result[axis][other];
      return offset - period * Math.round(offset / period);
    };
    return Math.hypot(along("y", result.period[0]), along("z", result.period[1]));
  }

  // The core in two views with one scale, x-y above x-z, and all layers cut through the hit point.
  function drawViews(place, { solid }, poses) {
    const traces = [], shapes = [];
    [["y", "x", "y"], ["z", "x2", "y2"]].forEach(([view, xaxis, yaxis], row) => {
      for (const { label, colour, [view]: [x, y] } of poses) {
        traces.push({
          type: "scatter", mode: "lines", x, y, xaxis, yaxis, name: label, legendgroup: label, showlegend: row === 0,
          fill: "toself", fillcolor: `${colour}40`, line: { color: colour, width: 1.5 }, hoverinfo: "skip",
        });
      }
      for (const [front, rear, low, high] of solid[view]) {
        shapes.push({
          type: "rect", xref: xaxis, yref: yaxis, x0: front, x1: rear, y0: low, y1: high,
          fillcolor: "#bbbbbb", line: { width: 0 }, layer: "below",
        });
      }
    });
    const range = (values, room, least) => {
      const [low, high] = [Math.min(...values), Math.max(...values)], half = Math.max((high - low) / 2 + room, least / 2);
      return [(low + high) / 2 - half, (low + high) / 2 + half];
    };
    const [x, y, z] = [["y", 0, 0], ["y", 1, 20], ["z", 1, 20]].map(([view, axis, least]) =>
      range(poses.flatMap((pose) => pose[view][axis]), 3, least));
    const perMm = Math.max(place.clientWidth - 70, 1) / (x[1] - x[0]), gap = 40, below = 95;
    const [high, low] = [y, z].map(([from, to]) => (to - from) * perMm), total = high + gap + low;
    const layout = {
      ...sheet, shapes, height: total + below + 10, margin: { l: 55, r: 15, t: 10, b: below },
      legend: { orientation: "h", y: -55 / total, yanchor: "top" },
      xaxis: { ...rule, range: x, anchor: "y", zeroline: false },
      yaxis: { ...rule, range: y, title: { text: "y [mm]" }, domain: [1 - high / total, 1], scaleanchor: "x", zeroline: false },
      xaxis2: { ...rule, range: x, anchor: "y2", title: { text: "x [mm]" }, zeroline: false },
      yaxis2: { ...rule, range: z, title: { text: "z [mm]" }, domain: [0, low / total], scaleanchor: "x2", zeroline: false },
    };
    return Plotly.react(place, traces, layout, { ...config, displayModeBar: false });
  }

  // The core in the plate and behind it, each in its place.
  function drawTrajectory([passage, flight], trajectory) {
    const { inside, behind } = trajectory;
    drawViews(passage, trajectory, inside);
    drawViews(flight, trajectory, [{ ...inside[0], label: "on impact" }, ...behind]);
  }

  // Sections of a hit: each a canvas whose cells have the colours of their labels, with a scale of 10 mm; then a legend.
  function drawPictures(place, { wide, tall, cell, codes, hits }, hit) {
    const make = (name, values, ...children) => {
      const made = Object.assign(document.createElement(name), values);
      made.append(...children);
      return made;
    };
    const channels = (colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
    const figures = hits[hit].map(([time, runs]) => {
      const canvas = make("canvas", { width: wide, height: tall }), context = canvas.getContext("2d");
      const image = context.createImageData(wide, tall);
      for (let k = 0, at = 0; k < runs.length; at += runs[k], k += 2) {
        if (!data.labels[runs[k + 1]]) continue;
        const pixel = [...channels(data.labels[runs[k + 1]][1]), 255];
        for (let one = at; one < at + runs[k]; one++) image.data.set(pixel, 4 * one);
      }
      context.putImageData(image, 0, 0);
      const scale = make("div", { className: "scale" }, "10 mm");
      scale.style.width = `${1000 / (wide * cell)}%`;
      return make("figure", {}, canvas, scale, make("figcaption", {}, `${number(time)} µs`));
    });
    const legend = codes.filter((code) => data.labels[code]).map((code) => {
      const entry = make("span", {}, data.labels[code][0]);
      entry.style.borderColor = data.labels[code][1];
      return entry;
    });
    place.replaceChildren(...figures, make("div", { className: "legend" }, ...legend));
  }

  function hitOf(result, point) {
    if (!result.nearest) return point.pointIndex;
    const [row, column] = point.pointIndex;
    return result.nearest[row][column];
  }

  // What grey says: how the hits ended that have no value; empty where all have one.
  function missing(result, variable) {
    if (variable === STATUS) return "";
    const without = result.status.map((_, hit) => hit).filter((hit) => result.columns[variable][hit] === null);
    const never = without.every((hit) => shareOf(result, hit) === 0);
    const counts = data.statuses.map(({ code, label }) => [without.filter((hit) => result.status[hit] === code).length, label]);
    const parts = counts.filter(([count]) => count).map(([count, label]) => `${label} ${count}`);
    return parts.length ? `${never ? "no core passes" : "no value"}: ${parts.join(", ")} of ${result.status.length} hits` : "";
  }

  return { distance, drawMap, drawPictures, drawTrajectory, hitOf, missing, number, hitLines };
}
