"use strict";
// The page: holds a design, asks for its maps while it changes, and shows what comes.
(async () => {
  const at = (id) => document.getElementById(id);
  const PATIENCE = 400;  // [ms] for a map of an older design, which then is given up
  const SLOW = 3000;  // [ms] without a map, after which the page says why
  const MOST_CHANGES = 4;  // that the title names
  const SETTLED = 350;  // [ms] without a change, after which a design can be undone
  const narrow = matchMedia("(max-width: 45rem)");
  const state = { design: {}, pins: [], variable: "residual velocity", origin: {} };
  const done = { undo: [], redo: [], last: "" };
  let level = 0, running = null, waiting = false, changedAt = 0, shown = null, settling = 0, chosen = null, followed = null, toml = "";
  let unread = false;  // a field has what is no value: its sentence stays, whatever map comes meanwhile

  const post = (path, body, signal) => fetch(path, {
    method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body), signal,
  });
  async function query(path, body) {
    const response = await post(path, body), text = await response.text();
    if (!response.ok) throw new Error(text || response.statusText);
    const value = JSON.parse(text);
    if (value.kind === "refused") throw new Error(value.sentence);
    return value;
  }
  const byName = (pins) => Object.fromEntries(pins.map(({ name, design }) => [name, design]));
  const lost = (error) => (error instanceof TypeError ? "warpimpact design does not answer any more; is it still running?" : error.message);

  function refuse(sentence) {
    at("sentence").textContent = sentence;
    at("sentence").hidden = false;
    for (const id of ["maps", "answer", "trajectory"]) at(id).classList.add("stale");
  }
  function accept() {
    if (unread) return;
    at("sentence").hidden = true;
    for (const id of ["maps", "trajectory"]) at(id).classList.remove("stale");
  }

  // Changes ---------------------------------------------------------------------------------------------------------

  function put(path, value) {
    let inside = state.design;
    path.slice(0, -1).forEach((part, k) => {
      if (typeof inside[part] !== "object") inside[part] = typeof path[k + 1] === "number" ? [] : {};
      inside = inside[part];
    });
    inside[path.at(-1)] = value;
  }
  function set(path, value) {
    put(path, value);
    touched();
  }
  async function change(what, layer, value) {
    try {
      const design = await query("change", { design: state.design, change: what, layer, value });
      settle();
      state.design = design;
      touched();
    } catch (error) {
      refuse(lost(error));
    }
  }
  const copied = (value) => JSON.parse(JSON.stringify(value));
  // The title says what has changed since a design was opened, until somebody writes one.
  function begin(design) {
    state.design = design;
    state.origin = { title: String(design.title ?? ""), design: copied(design) };
  }
  const leaves = (part, path = []) => (part !== null && typeof part === "object"
    ? Object.entries(part).flatMap(([key, inner]) => leaves(inner, [...path, key]))
    : [[path, part]]);
  function follow() {
    const { title, design } = state.origin;
    if (title === undefined) return;
    const before = new Map(leaves(design).map(([path, value]) => [path.join("."), value]));
    const changes = leaves(state.design).filter(([path, value]) => path[0] !== "title" && before.get(path.join(".")) !== value);
    const words = changes.map(([path, value]) => {
      const layer = path[0] === "layer" ? `layer ${Number(path[1]) + 1} ` : "";
      return `${layer}${path.findLast((part) => Number.isNaN(Number(part))).replaceAll("_", " ")} ${value}`;
    });
    const more = words.length > MOST_CHANGES ? [`${words.length - MOST_CHANGES} more`] : [];
    state.design.title = [title, ...words.slice(0, MOST_CHANGES), ...more].join(", ").slice(0, 200);
  }
  function fitTitle() {
    at("title").style.height = "auto";
    at("title").style.height = `${at("title").scrollHeight}px`;
  }
  function touched() {
    unread = false;
    follow();
    changedAt = performance.now();
    clearTimeout(settling);
    settling = setTimeout(settle, SETTLED);
    refresh();
  }
  // A design that stays for a while can be undone, and is in the address.
  function settle() {
    clearTimeout(settling);
    const now = JSON.stringify(state.design);
    if (now !== done.last) {
      if (done.last) done.undo.push(done.last);
      done.redo = [];
      done.last = now;
    }
    buttons();
    address.packed(state).then((text) => history.replaceState(null, "", `#${text}`));
  }
  function step(from, to) {
    settle();
    if (!from.length) return;
    to.push(done.last);
    done.last = from.pop();
    state.design = JSON.parse(done.last);
    document.activeElement?.blur();
    touched();
    buttons();
  }
  function buttons() {
    at("undo").disabled = !done.undo.length;
    at("redo").disabled = !done.redo.length;
  }

  // Computing -------------------------------------------------------------------------------------------------------

  // One computation at a time: the first map of an older design may end if that takes no longer than PATIENCE, all else
  // that is under way is given up.
  function refresh() {
    if (running && !running.answered) {
      const left = PATIENCE - (performance.now() - running.begun);
      waiting = true;
      if (left > 0) {
        if (!running.timer) running.timer = setTimeout(compute, left);
        return;
      }
    }
    compute();
  }
  async function compute() {
    if (running) {
      clearTimeout(running.timer);
      running.abort.abort();
    }
    const own = { abort: new AbortController(), answered: false, begun: performance.now(), changedAt, level, times: {} };
    running = own;
    waiting = false;
    const text = JSON.stringify(state.design), pins = JSON.parse(JSON.stringify(state.pins));
    setTimeout(() => {
      if (running !== own || own.answered) return;
      at("status").textContent = "Computing… The first map of a new kind of target takes up to a minute, once: its kernels are built.";
    }, SLOW);
    try {
      const response = await post("compute", { design: state.design, pins: byName(pins), level }, own.abort.signal);
      if (!response.ok) throw new Error(await response.text());
      for await (const line of linesOf(response.body)) {
        if (running !== own) return;
        own.times[line.kind] ??= performance.now() - own.changedAt;
        await take(line, own, text, pins);
        if (own.answered && waiting) { compute(); return; }
      }
    } catch (error) {
      if (error.name !== "AbortError" && running === own) refuse(lost(error));
    }
    if (running === own) own.answered = true;
  }
  async function* linesOf(stream) {
    let rest = "";
    for await (const chunk of readable(stream.pipeThrough(new TextDecoderStream()))) {
      const parts = (rest + chunk).split("\n");
      rest = parts.pop();
      for (const part of parts) yield JSON.parse(part);
    }
  }
  async function* readable(stream) {
    const reader = stream.getReader();
    for (;;) {
      const { done: ended, value } = await reader.read();
      if (ended) return;
      yield value;
    }
  }
  async function take(line, own, text, pins) {
    if (line.kind === "refused") {
      own.answered = true;
      refuse(line.sentence);
      toml = "";
      at("save").disabled = true;
      at("status").textContent = shown ? "No map of this design. The one below is of the design before." : "No map.";
    } else if (line.kind === "kept") {
      at("status").textContent = line.sentence;
    } else if (line.kind === "plate") {
      showPlate(line);
    } else if (line.kind === "numbers") {
      const open = at("every")?.open;
      at("answer").innerHTML = line.html;
      if (open && at("every")) at("every").open = true;
      headed(at("answer"));
      at("answer").classList.remove("stale");
    } else {
      accept();
      if (line.level !== null) level = line.level;
      await show({ ...line, design: JSON.parse(text), pins, startLevel: own.level });
      if (!own.answered) {
        own.answered = true;
        performance.measure("first map", { start: own.changedAt, end: performance.now(), detail: own.times });
      }
    }
  }

  // Showing ---------------------------------------------------------------------------------------------------------

  const viewOf = plateView(at("plate"), at("section"), (path, value) => set(path, `${value} mm`));
  const controls = controlsOf(at("controls"), { set, change, refuse: (sentence) => { unread = true; refuse(sentence); } });

  function showPlate({ plate, groups, choices, toml: file, title, notes, tested }) {
    toml = file;
    at("save").disabled = false;
    if (document.activeElement !== at("title")) at("title").value = title;
    fitTitle();
    document.title = `${title} · warpimpact design`;
    controls(groups, choices);
    const lengths = groups.flatMap(({ controls: all }) => all).filter(({ unit }) => unit === "mm");
    viewOf(plate, lengths.map(({ path, value }) => [path, value]));
    const rows = Object.entries({ thickness: plate.thickness, ...plate.numbers });
    const cells = rows.flatMap(([name, value]) => [["dt", name, ""], ["dd", value, ""]]);
    for (const note of notes) cells.push(["dt", "note", "warns"], ["dd", note, ""]);
    at("numbers").replaceChildren(...cells.map(([tag, words, className]) => make(tag, { className }, words)));
    const [summary, ...details] = tested;
    at("tested").firstElementChild.textContent = summary;
    at("tested").lastElementChild.replaceChildren(...details.map((words) => make("li", {}, words)));
  }

  // On a narrow page a table is a list, whose entries have the heads of their columns.
  function headed(place) {
    for (const table of place.querySelectorAll("table")) {
      const heads = [...table.querySelectorAll("thead th")].map(({ textContent }) => textContent);
      for (const row of table.rows) [...row.cells].forEach((cell, k) => { if (k && heads[k]) cell.dataset.head = heads[k]; });
    }
  }
  const NAMES = { first: "First look", draft: "Draft", full: "Complete", elements: "Complete, with finite elements" };
  const FOLLOWING = {
    "": "", draft: " The map gets finer while nothing moves.", full: " The map gets finer while nothing moves.",
    elements: " Finite elements compute some of its hits now, for seconds to minutes; then the answer gets narrower.",
  };
  async function show(line) {
    const same = shown && shown.stage === line.stage && JSON.stringify(shown.design) === JSON.stringify(line.design);
    shown = line;
    if (!same) chosen = null;
    const more = FOLLOWING[line.following], name = line.following === "elements" ? "By the fast law" : NAMES[line.stage];
    const of = ["first", "draft"].includes(line.stage) && line.total > line.hits ? `${line.hits} of ${line.total}` : line.hits;
    at("status").replaceChildren(make("strong", {}, name), `: ${of} ${of === 1 ? "hit" : "hits"}. ${line.numerics}${more}`);
    at("status").classList.toggle("warns", !line.kept);
    fillVariables(line.data);
    at("hit-number").max = line.hits - 1;
    at("answer").classList.add("stale");
    await drawMaps();
    if (!same && !at("trajectory").hidden) at("note").textContent = `${at("note").textContent.replace(/ \(of an earlier.*/, "")} (of an earlier map)`;
  }
  // The variable that was chosen, unless no hit has a value of it.
  function shownVariable({ main, results }, keys) {
    const there = (key) => results.some(({ columns }) => columns[key]?.some((value) => value !== null));
    const wanted = [state.variable, ...main].find((key) => keys.includes(key) && (key === "status" || there(key)));
    return wanted ?? "status";
  }
  function fillVariables(data) {
    const { variables } = data, keys = [...variables.map(({ key, label }) => [key, label]), ["status", "how the shots ended"]];
    const picker = at("variable"), now = JSON.stringify(keys);
    if (picker.dataset.keys !== now) {
      picker.dataset.keys = now;
      picker.replaceChildren(...keys.map(([value, text]) => new Option(text, value)));
    }
    picker.value = shownVariable(data, keys.map(([key]) => key));
  }
  async function drawMaps() {
    const { data } = shown, maps = hitMaps(data), names = ["this design", ...shown.pins.map(({ name }) => name)];
    while (at("maps").children.length > names.length) at("maps").lastChild.remove();
    await Promise.all(names.map(async (name, k) => {
      if (!at(`map-${k}`)) at("maps").append(mapPlace(k));
      at(`name-${k}`).hidden = names.length === 1;
      at(`name-${k}`).firstChild.textContent = name;
      const marked = chosen && chosen.result === k ? { chosen: chosen.hit } : {};
      const place = await maps.drawMap(at(`map-${k}`), data.results[k], at("variable").value, { ...marked, tallest: narrow.matches ? 0.24 * innerHeight : 520, tight: narrow.matches });
      const grey = maps.missing(data.results[k], at("variable").value);
      at(`grey-${k}`).hidden = !grey;
      at(`grey-${k}`).lastChild.textContent = ` ${grey}`;
      if (!place.dataset.clicks) {
        place.dataset.clicks = "yes";
        place.on("plotly_click", ({ points }) => {
          const point = points.find(({ curveNumber }) => curveNumber === 0);
          if (point) choose(k, hitMaps(shown.data).hitOf(shown.data.results[k], point));
        });
      }
    }));
  }
  function mapPlace(k) {
    const unpin = () => { state.pins.splice(k - 1, 1); settle(); touched(); };
    const name = make("h3", { id: `name-${k}`, className: "pinned" }, make("span"));
    if (k) name.append(make("button", { onclick: unpin }, "Unpin"));
    const grey = make("p", { id: `grey-${k}`, className: "soft" }, make("span", { className: "swatch" }), "");
    return make("div", {}, name, make("div", { id: `map-${k}`, className: "map" }), grey);
  }

  // A hit -----------------------------------------------------------------------------------------------------------

  async function choose(k, place) {
    const own = shown, result = own.data.results[k], hit = result.number[place];
    const about = { design: k ? own.pins[k - 1].design : own.design, level: own.startLevel, stage: own.stage, hit };
    chosen = { result: k, hit: place };
    drawMaps();
    at("trajectory").hidden = false;
    at("note").textContent = `Following hit ${hit}…`;
    try {
      const { text, views, figures } = await query("trajectory", about);
      at("note").textContent = `Trajectory of hit ${hit}, a replay by the fast law${own.pins.length ? ` on ${k ? own.pins[k - 1].name : "this design"}` : ""}.`;
      at("hit-text").textContent = text;
      at("trajectory").classList.remove("stale");
      followed = views;
      await hitMaps(own.data).drawTrajectory([at("passage"), at("flight")], views);
      at("figure").hidden = true;
      at("figures").replaceChildren(...figures.map((name) => make("button", { onclick: () => showFigure(about, name) }, name)));
    } catch (error) {
      at("note").textContent = lost(error);
    }
  }
  async function showFigure(about, figure) {
    at("note").textContent = `Drawing ${figure} of hit ${about.hit}…`;
    try {
      const { image } = await query("figure", { ...about, figure });
      Object.assign(at("figure"), { src: image, alt: `${figure} of hit ${about.hit}`, hidden: false });
      at("note").textContent = `Trajectory of hit ${about.hit}, a replay by the fast law.`;
    } catch (error) {
      at("note").textContent = lost(error);
    }
  }

  // Files and buttons -----------------------------------------------------------------------------------------------

  function download(text, name, type) {
    const link = document.createElement("a"), place = URL.createObjectURL(new Blob([text], { type }));
    Object.assign(link, { href: place, download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(place), 10_000);
  }
  const fileName = () => (at("title").value.toLowerCase().replace(/[^a-z0-9]+/g, "_").replace(/^_|_$/g, "").slice(0, 60) || "design");
  const save = () => { if (toml) download(toml, `${fileName()}.toml`, "application/toml"); };
  function pin() {
    if (state.pins.length >= 5) { refuse("Five designs are pinned already; unpin one first."); return; }
    const used = state.pins.map(({ name }) => name);
    const name = Array.from("ABCDEF", (letter) => `pin ${letter}`).find((one) => !used.includes(one));
    state.pins.push({ name, design: JSON.parse(JSON.stringify(state.design)) });
    settle();
    touched();
  }
  async function busy(id, words, work) {
    const idle = at(id).textContent;
    at(id).disabled = true;
    at(id).textContent = words;
    try {
      await work({ design: state.design, pins: byName(state.pins) });
    } catch (error) {
      refuse(lost(error));
    }
    at(id).disabled = false;
    at(id).textContent = idle;
  }
  const report = () => busy("report", "Writing…", async (designs) => {
    const { html } = await query("report", { ...designs, stage: shown?.stage === "elements" ? "elements" : "full" });
    download(html, `${fileName()}.html`, "text/html");
  });
  function load(design) {
    settle();
    begin(design);
    touched();
  }
  async function open(file) {
    try {
      load(await query("open", { text: await file.text(), name: file.name }));
    } catch (error) {
      refuse(lost(error));
    }
  }

  at("undo").addEventListener("click", () => step(done.undo, done.redo));
  at("redo").addEventListener("click", () => step(done.redo, done.undo));
  at("pin").addEventListener("click", pin);
  at("save").addEventListener("click", save);
  at("report").addEventListener("click", report);
  at("copy").addEventListener("click", async () => {
    settle();
    history.replaceState(null, "", `#${await address.packed(state)}`);
    await navigator.clipboard.writeText(`${location.origin}/${location.hash}`); // not the token: it goes to others
    at("copy").textContent = "Copied";
    setTimeout(() => { at("copy").textContent = "Copy address"; }, 1500);
  });
  at("open").addEventListener("click", () => at("file").click());
  at("file").addEventListener("change", () => { if (at("file").files.length) open(at("file").files[0]); at("file").value = ""; });
  at("title").addEventListener("input", () => {
    at("title").value = at("title").value.replaceAll("\n", " ");
    fitTitle();
    state.origin = {};
    set(["title"], at("title").value);
  });
  at("variable").addEventListener("change", () => { state.variable = at("variable").value; drawMaps(); settle(); });
  at("hit-number").addEventListener("change", () => {
    const text = at("hit-number").value.trim(), numbers = shown?.data.results[0].number ?? [];
    const place = /^\d+$/.test(text) ? numbers.indexOf(Number(text)) : -1;
    at("hit-number").setCustomValidity(place < 0 && text ? `No hit ${text}: they are ${numbers[0]} to ${numbers.at(-1)}.` : "");
    at("hit-number").reportValidity();
    if (place >= 0) choose(0, place);
  });
  addEventListener("keydown", (event) => {
    const typing = event.target.matches("input:not([type=range]):not([type=checkbox]), select, textarea");
    const key = event.key.toLowerCase(), command = event.ctrlKey || event.metaKey;
    if (command && (key === "z" || key === "y") && !typing) {
      event.preventDefault();
      if (key === "y" || event.shiftKey) step(done.redo, done.undo); else step(done.undo, done.redo);
    } else if (!command && !event.altKey && !typing) {
      if (key === "p") pin();
      if (key === "s") save();
    }
  });
  const redraw = () => {
    fitTitle();
    if (shown) drawMaps();
    if (followed) hitMaps(shown.data).drawTrajectory([at("passage"), at("flight")], followed);
  };
  let resized = 0;
  addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(redraw, 150); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

  // The beginning ---------------------------------------------------------------------------------------------------

  async function opened() {
    try {
      const held = await address.unpacked(location.hash.slice(1));
      if (typeof held.design !== "object") return false;
      const pins = (Array.isArray(held.pins) ? held.pins : []).filter((one) => typeof one?.design === "object");
      const origin = held.origin ?? {};
      leaves([held.design, origin]);  // which refuses what is nested too deep
      begin(held.design);
      if (typeof origin.design === "object") state.origin = { title: String(origin.title), design: origin.design };
      else if (held.origin) state.origin = {};
      state.pins = pins.map(({ name, design }) => ({ name: String(name).slice(0, 80), design }));
      state.variable = String(held.variable ?? state.variable);
      return true;
    } catch {
      return false;
    }
  }
  const { designs } = await (await fetch("start")).json(), names = Object.keys(designs);
  at("designs").replaceChildren(...names.map((name) => new Option(name, name)));
  at("designs-label").hidden = names.length < 2;
  at("designs").addEventListener("change", () => load(copied(designs[at("designs").value])));
  addEventListener("hashchange", async () => { if (await opened()) { settle(); touched(); } });
  if (!(location.hash.length > 1 && await opened())) begin(copied(designs[names[0]]));
  touched();
})();
