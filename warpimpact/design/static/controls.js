"use strict";
// An element with some properties and what is in it.
function make(name, properties, ...inner) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...inner);
  return element;
}
// A number as it is typed in any country, with what stands behind it; null for other text. A comma is that of decimals;
// before three digits it might be that of thousands.
function numberIn(text) {
  const match = /^([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[+-]?\d+)?)\s*([^\d\s.,].*)?$/i.exec(text.trim());
  if (!match || /^[+-]?[1-9]\d*,\d{3}$/.test(match[1])) return null;
  return { value: Number(match[1].replace(",", ".")), unit: match[2] };
}
// Sliders, numbers and choices. `set(path, value)` changes a value of the design, `change(what, layer, value)` more;
// `refuse(sentence)` shows what is wrong.
function controlsOf(place, { set, change, refuse }) {
  const PAUSE = 300;  // [ms] after which what is typed counts as whole
  let shape = "";
  const update = new Map();
  const decimals = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const written = (value, { unit }) => (unit ? `${value} ${unit}` : value);

  function slider(control, id) {
    const { label, unit, low, step, meaning, path } = control;
    const range = make("input", { type: "range", id, min: low, max: control.high, step, title: meaning });
    const number = make("input", { type: "text", inputMode: "decimal", id: `${id}-number`, autocomplete: "off", title: meaning });
    number.setAttribute("aria-label", `${label}${unit ? ` in ${unit}` : ""}`);
    // A slider stands on its value exactly, also between two of its steps.
    const stand = (value, most) => {
      const steps = (value - low) / step;
      Object.assign(range, { min: Math.min(low, value), max: Math.max(most, value), step: Math.abs(steps - Math.round(steps)) < 1e-6 ? step : "any" });
      range.value = value;
    };
    range.addEventListener("input", () => {
      const value = Number((Math.round(Number(range.value) / step) * step).toFixed(decimals(step)));
      number.value = value;
      set(path, written(value, control));
    });
    let pause = 0, taken = "";
    const take = () => {
      clearTimeout(pause);
      if (number.value.trim() === "" || number.value === taken) return;
      taken = number.value;
      const typed = numberIn(taken);
      if (!typed) {
        const wanted = unit ? `a number in ${unit}` : "a number";
        refuse(`${label}: got "${taken}", but it takes ${wanted}, without a separator of thousands, such as 8.5 or 8,5`);
      } else if (typed.unit) {
        set(path, written(typed.value, typed));
      } else {
        stand(typed.value, control.high);
        set(path, written(typed.value, control));
      }
    };
    number.addEventListener("input", () => { clearTimeout(pause); pause = setTimeout(take, PAUSE); });
    number.addEventListener("change", take);
    update.set(id, ({ value, high, scatters }) => {
      for (const one of [range, number]) {
        one.disabled = scatters;
        if (scatters) one.title = "It scatters from shot to shot; change its distribution in the campaign file.";
      }
      if (document.activeElement !== range) stand(value, high);
      else if (Math.abs(range.value - value) > step) range.value = value;
      if (document.activeElement !== number) { number.value = value; taken = ""; }
    });
    return make("div", { className: "control" }, make("label", { htmlFor: id, title: meaning }, label), number,
      make("span", { className: "unit" }, unit), range);
  }

  function choice(control, id, layer, choices) {
    const own = control.what === "shape" ? [] : [["", "own values"]];
    const names = [...own, ...choices[control.what].map((name) => [name, name])];
    if (!names.some(([value]) => value === control.value)) names.push([control.value, control.value]);
    const select = make("select", { id }, ...names.map(([value, text]) => make("option", { value }, text)));
    select.addEventListener("change", () => change(control.what, layer, select.value));
    update.set(id, ({ value }) => { select.value = value; });
    return make("div", { className: "control" }, make("label", { htmlFor: id }, control.label), select);
  }

  function toggle(control, id) {
    const box = make("input", { type: "checkbox", id });
    box.addEventListener("change", () => set(control.path, box.checked));
    update.set(id, ({ value }) => { box.checked = value; });
    return make("div", { className: "control" }, make("label", { htmlFor: id, title: control.meaning }, control.label), box);
  }

  const idOf = ({ path }) => `control-${path.join("-")}`;

  // Show the controls of a design; they stay the same elements as long as it has the same ones.
  return (groups, choices) => {
    const now = JSON.stringify([groups.map(({ name, controls }) => [name, controls.map((one) => [one.kind, one.path])]), choices]);
    if (now !== shape) {
      shape = now;
      update.clear();
      place.replaceChildren(...groups.map(({ name, layer, controls }) => {
        const inner = controls.map((one) => {
          if (one.kind === "choice") return choice(one, idOf(one), layer ?? 0, choices);
          return (one.kind === "switch" ? toggle : slider)(one, idOf(one));
        });
        const group = make("fieldset", {}, make("legend", {}, name), ...inner);
        if (layer) {
          const button = make("button", { type: "button" }, "Remove this layer");
          button.addEventListener("click", () => change("remove layer", layer, ""));
          group.append(button);
        }
        return group;
      }));
      const button = make("button", { type: "button", id: "add-layer" }, "Add a layer");
      button.addEventListener("click", () => change("add layer", 0, ""));
      place.append(button);
    }
    for (const { controls } of groups) for (const one of controls) update.get(idOf(one))(one);
  };
}
