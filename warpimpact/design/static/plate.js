"use strict";
// The plate and the section of the target, to scale in mm, with grips. `drag(path, value)` is told the new length in mm.
function plateView(plate, section, drag) {
  const SVG = "http://www.w3.org/2000/svg";
  const make = (name, attributes, text) => {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text !== undefined) element.textContent = text;
    return element;
  };
  const views = new Map([plate, section].map((svg) => {
    const view = { drawn: make("g", {}), grips: make("g", {}), handles: new Map(), dragging: null };
    svg.append(view.drawn, view.grips);
    return [svg, view];
  }));
  const values = new Map();  // lengths [mm] by path, as the design has them

  const pointOf = (svg, event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [point.x, -point.y];
  };
  const rounded = (value) => Math.max(0, Math.round(value * 10) / 10);

  function grip(svg, view, key) {
    const element = make("circle", { class: "grip", tabindex: 0, role: "slider", "aria-label": JSON.parse(key).join(" ") });
    const move = (to, { handle, value }) => {
      const way = (to[0] - handle.at[0]) * handle.direction[0] + (to[1] - handle.at[1]) * handle.direction[1];
      drag(handle.path, rounded(value + handle.gain * way));
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      view.dragging = { handle: view.handles.get(key).handle, value: values.get(key), from: pointOf(svg, event) };
      event.preventDefault();
      element.focus();
    });
    element.addEventListener("pointermove", (event) => {
      if (!view.dragging) return;
      const { handle, from } = view.dragging, to = pointOf(svg, event);
      move([handle.at[0] + to[0] - from[0], handle.at[1] + to[1] - from[1]], view.dragging);
    });
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => { view.dragging = null; });
    element.addEventListener("keydown", (event) => {
      const step = { ArrowUp: 0.1, ArrowRight: 0.1, ArrowDown: -0.1, ArrowLeft: -0.1, PageUp: 1, PageDown: -1 }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      drag(view.handles.get(key).handle.path, rounded(values.get(key) + step));
    });
    return element;
  }

  function place(svg, handles, size) {
    const view = views.get(svg), keys = handles.map(({ path }) => JSON.stringify(path));
    for (const [key, { element }] of view.handles) if (!keys.includes(key)) { element.remove(); view.handles.delete(key); }
    handles.forEach((handle, k) => {
      const known = view.handles.get(keys[k]) ?? { element: grip(svg, view, keys[k]) };
      known.handle = handle;
      view.handles.set(keys[k], known);
      if (!known.element.parentNode) view.grips.append(known.element);
      const [y, z] = handle.at;
      const shown = { cx: y, cy: -z, r: size, "stroke-width": 0.4 * size, "aria-valuenow": values.get(keys[k]) };
      for (const [name, value] of Object.entries(shown)) known.element.setAttribute(name, value);
    });
  }

  // While a grip is dragged, the frame stays: else the scale would change under the pointer.
  const frame = (svg, box) => { if (!views.get(svg).dragging) svg.setAttribute("viewBox", box.join(" ")); };

  function label(text, [y, z], size) {
    return make("text", { class: "label", x: y, y: -z, "font-size": size, "stroke-width": 0.2 * size }, text);
  }

  function dimension({ start, end, text }, kind, size) {
    const group = make("g", {});
    const line = { x1: start[0], y1: -start[1], x2: end[0], y2: -end[1], "stroke-width": 0.12 * size };
    const upright = Math.abs(end[1] - start[1]) > Math.abs(end[0] - start[0]);
    const middle = [(start[0] + end[0]) / 2 + (upright ? 0.9 * size : 0), (start[1] + end[1]) / 2 + (upright ? 0 : 0.6 * size)];
    const length = Math.hypot(end[0] - start[0], end[1] - start[1]) || 1;
    const across = [-(end[1] - start[1]) / length, (end[0] - start[0]) / length];
    group.append(make("line", { class: kind, ...line }));
    for (const [y, z] of [start, end]) {
      const tick = 0.35 * size;
      group.append(make("line", {
        class: kind, "stroke-width": 0.12 * size, x1: y - tick * across[0], y1: -(z - tick * across[1]),
        x2: y + tick * across[0], y2: -(z + tick * across[1]),
      }));
    }
    group.append(label(text, middle, size));
    return group;
  }

  // Where the shots fly, in the lower right corner: an arrow with its angle, or words where they fly at the reader.
  function fireArrow({ along: [y, z], text }, [wide, tall], size) {
    const at = [wide / 2 - 3.2 * size, -tall / 2 + 1.2 * size], parts = [label(text, at, size)];
    if (y || z) {
      const middle = [at[0], at[1] + 2.6 * size], place = (along, across) =>
        [middle[0] + size * (along * y - across * z), -(middle[1] + size * (along * z + across * y))].join(" ");
      const line = `M${place(-1.6, 0)} L${place(1, 0)} M${place(1.6, 0)} L${place(0.8, 0.4)} L${place(0.8, -0.4)} Z`;
      parts.push(make("path", { class: "fire", d: line, "stroke-width": 0.2 * size }));
    }
    return parts;
  }

  function drawPlate({ extent, path, cell, core, dimensions, ligament, fire, handles }) {
    const [wide, tall] = extent, size = 0.032 * Math.max(wide, tall), { drawn } = views.get(plate);
    frame(plate, [-wide / 2, -tall / 2, wide, tall]);
    const parts = [make("path", { class: "hole", d: path, "fill-rule": "evenodd", "stroke-width": 0.06 * size })];
    if (cell) {
      const [y, z] = cell;
      parts.push(make("rect", {
        class: "cell", x: -y / 2, y: -z / 2, width: y, height: z, "stroke-width": 0.12 * size,
        "stroke-dasharray": `${0.6 * size} ${0.4 * size}`,
      }));
    }
    parts.push(make("circle", { class: "core", r: core, "stroke-width": 0.12 * size }));
    parts.push(...dimensions.map((one) => dimension(one, "line", size)));
    if (ligament) parts.push(dimension(ligament, "ligament", size));
    parts.push(...fireArrow(fire, extent, size));
    drawn.replaceChildren(...parts);
    place(plate, handles, 0.5 * size);
  }

  function drawSection({ half, layers, handles }) {
    const deep = layers.at(-1).rear, { drawn } = views.get(section);
    const wide = Math.max(deep * 1.15, 2 * half * 0.5), size = 0.065 * Math.max(wide / 3, 2 * half);
    frame(section, [(deep - wide) / 2, -half - 2.2 * size, wide, 2 * half + 3 * size]);
    const parts = [];
    layers.forEach(({ front, rear, parts: solid, text }, k) => {
      for (const [low, high] of solid) {
        parts.push(make("rect", { class: "solid", x: front, y: -high, width: rear - front, height: high - low }));
      }
      const anchor = layers.length > 1 && k === 0 ? "start" : layers.length > 1 && k === layers.length - 1 ? "end" : "middle";
      const x = anchor === "start" ? front : anchor === "end" ? rear : (front + rear) / 2;
      parts.push(make("text", { class: "caption", x, y: -half - 0.8 * size, "font-size": size, style: `text-anchor:${anchor}` }, text));
    });
    drawn.replaceChildren(...parts);
    place(section, handles, 0.4 * size);
  }

  // `lengths` are the values [mm] of sliders, by path.
  return (geometry, lengths) => {
    values.clear();
    for (const [path, value] of lengths) values.set(JSON.stringify(path), value);
    const known = (handles) => handles.filter(({ path }) => values.has(JSON.stringify(path)));
    drawPlate({ ...geometry, handles: known(geometry.handles) });
    drawSection({ ...geometry.section, handles: known(geometry.section.handles) });
  };
}
