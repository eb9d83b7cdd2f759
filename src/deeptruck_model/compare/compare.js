// Panels of several drives over one axis: what is marked in one is marked in all, and given in numbers.
"use strict";

const DATA = JSON.parse(document.getElementById("drives").textContent);
const byId = id => document.getElementById(id);
const COLOURS = ["#222222", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9"];
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3], [4, 4], [1, 3]];
const colour = k => COLOURS[k % COLOURS.length], dash = k => DASHES[k % DASHES.length];

const state = {by: "time", offsets: DATA.sides.map(s => s.offset_s), mark: null, window: null, cursor: null};
const MOST_NATIVE = 5000, MOST_DOTS = 8000;  // samples of a side that are drawn as they were sampled; dots
const LABELS = Object.fromEntries(DATA.channels.map(c => [c.name, c.label]));
const kept = [];  // [from, to] of the first side, s

const decoded = new Map();

// A channel of side k as it was sampled; undefined where it has none.
function native(k, name) {
  const text = DATA.sides[k].native.columns[name], key = `${k} ${name}`;
  if (text !== undefined && !decoded.has(key)) {
    const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
    decoded.set(key, new Float32Array(bytes.buffer));
  }
  return decoded.get(key);
}

const means = new Map();

// The same as means of the drawn step, null where nothing is known.
function coarse(k, name) {
  const side = DATA.sides[k], key = `${k} ${name}`;
  if (side.columns[name]) return side.columns[name];
  if (!means.has(key)) {
    const values = native(k, name), n = side.columns.speed.length;
    if (!values) return undefined;
    const sum = new Float64Array(n), count = new Float64Array(n);
    values.forEach((v, i) => {
      const at = Math.floor(i * side.native.step_s / DATA.step_s + 1e-6);
      if (at < n && !Number.isNaN(v)) { sum[at] += v; count[at] += 1; }
    });
    means.set(key, Array.from(sum, (s, i) => count[i] ? s / count[i] : null));
  }
  return means.get(key);
}

// Side k's samples of a channel in the window: as they were sampled where these are few, else means.
function line(k, name) {
  const {step_s: step} = DATA.sides[k].native, [from, to] = state.window, values = native(k, name);
  if (state.by !== "time" || !values || (to - from) / step > MOST_NATIVE) return {xs: places(k), ys: coarse(k, name)};
  const first = Math.max(0, Math.floor((from - state.offsets[k]) / step) - 1);
  const last = Math.max(first, Math.min(values.length, Math.ceil((to - state.offsets[k]) / step) + 2));
  const ys = Array.from(values.subarray(first, last), v => Number.isNaN(v) ? null : v);
  return {xs: ys.map((_, i) => state.offsets[k] + (first + i) * step), ys};
}

// How far side k is from the first, at the first one's samples in the window.
function apartLine(k, name) {
  const ours = line(0, name), theirs = line(k, name), hint = {i: 0};
  if (!ours.ys || !theirs.ys) return {xs: ours.xs, ys: null};
  const ys = ours.xs.map((x, i) => {
    if (!known(x) || !known(ours.ys[i])) return null;
    const there = valueAt(theirs.xs, theirs.ys, x, hint);
    return there === null ? null : there - ours.ys[i];
  });
  return {xs: ours.xs, ys};
}

const chosen = () => state.mark && state.mark[1] > state.mark[0] ? state.mark : state.window;
const within = x => known(x) && x >= chosen()[0] && x <= chosen()[1];

// The clock of a side's drawn means, s of the first side.
const clock = k => DATA.sides[k].columns.speed.map((_, i) => state.offsets[k] + (i + 0.5) * DATA.step_s);

// Where each sample of a side lies on the axis that is chosen; null where it lies nowhere.
function places(k) {
  const side = DATA.sides[k];
  if (state.by === "place") return side.place || side.columns.speed.map(() => null);
  return clock(k);
}

// The value of a line at x; null outside it, and next to what is unknown.
function valueAt(xs, ys, x, hint) {
  let i = hint.i;
  while (i + 1 < xs.length && (!known(xs[i + 1]) || xs[i + 1] < x)) i++;
  while (i > 0 && (!known(xs[i]) || xs[i] > x)) i--;
  hint.i = i;
  if (i + 1 >= xs.length || ![xs[i], xs[i + 1], ys[i], ys[i + 1]].every(known)) return null;
  if (x < xs[i] || x > xs[i + 1]) return null;
  const wide = xs[i + 1] - xs[i];
  return wide > 0 ? ys[i] + (ys[i + 1] - ys[i]) * (x - xs[i]) / wide : ys[i];
}

function difference(k, name) {
  const ours = DATA.sides[0].columns[name], theirs = DATA.sides[k].columns[name];
  if (!ours || !theirs) return null;
  const x0 = places(0), xk = places(k), hint = {i: 0};
  return x0.map((x, i) => {
    if (!known(x) || !known(ours[i])) return null;
    const there = valueAt(xk, theirs, x, hint);
    return there === null ? null : there - ours[i];
  });
}

const views = [];

function addPanel(title, label, lines) {
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  caption.textContent = title;
  figure.tabIndex = 0;
  figure.setAttribute("role", "img");
  figure.setAttribute("aria-label", `${title}; arrow keys move what is marked`);
  figure.append(caption);
  byId("panels").append(figure);
  const under = chart => {
    if (state.mark) chart.span(...state.mark, MARK, 0.15);
    if (state.by === "time") for (const [a, b] of kept) chart.span(a, b, "#555555", 0.25);
  };
  const chart = new Chart(figure, {height: 190, group: "drives", marked: mark, moved: point, under});
  views.push({chart, label, lines});
  figure.addEventListener("keydown", pressed);
}

let pointing = false;

function point(x) {
  state.cursor = x;
  if (!pointing) requestAnimationFrame(() => { pointing = false; byId("cursor").textContent = pointed(); });
  pointing = true;
}

// The values of all panels at the cursor.
function pointed() {
  if (state.cursor === null) return "";
  const x = state.cursor, unit = state.by === "place" ? "m" : "s";
  const said = views.map(({label, lines}) => {
    const values = lines().filter(l => l.ys).map(({xs, ys}) => valueAt(xs, ys, x, {i: 0}));
    return values.some(v => v !== null) ? `${label}: ${values.map(v => v === null ? "–" : v.toPrecision(4)).join(" | ")}` : "";
  });
  return `At ${x.toFixed(2)} ${unit}, sides in order. ${said.filter(Boolean).join("; ")}`;
}

function pressed(event) {
  const [from, to] = state.window, step = (to - from) / 50;
  const way = {ArrowLeft: -1, ArrowRight: 1}[event.key];
  if (event.key === "Escape") state.mark = null;
  else if (way === undefined) return;
  else if (!state.mark) state.mark = [(from + to) / 2 - step, (from + to) / 2 + step];
  else if (event.shiftKey) state.mark = [state.mark[0], Math.max(state.mark[0], state.mark[1] + way * step)];
  else state.mark = state.mark.map(x => x + way * step);
  event.preventDefault();
  draw();
}

function mark(a, b) {
  state.mark = [Math.min(a, b), Math.max(a, b)];
  draw();
}

function whole() {
  const all = DATA.sides.map((_, k) => places(k));
  const firsts = all[0].filter(known);
  state.window = state.by === "place" && firsts.length ? reach([firsts], 0) : reach(all, 0);
}

function draw() {
  const axis = state.by === "place" ? "distance along the road, m" : "time, s", [from, to] = state.window;
  for (const {chart, label, lines} of views) {
    const drawn = lines().filter(line => line.ys).map(({xs, ys, k}) => ({xs, ys, colour: colour(k), width: 1.5, dash: dash(k)}));
    const inside = drawn.map(({xs, ys}) => ys.filter((_, i) => known(xs[i]) && xs[i] >= from && xs[i] <= to));
    chart.draw(drawn, state.window, reach(inside), axis, label);
  }
  byId("marked").textContent = described();
  DATA.sides.forEach((side, k) => { if (k) byId("key").children[k].lastChild.textContent = `${side.name}${fitted(k)}`; });
  drawAgainst();
  tellResidual();
}

// How well the speed of side k fits the first one's, over the marked or shown rows.
function fitted(k) {
  const {xs, ys} = apartLine(k, "speed"), own = line(0, "speed");
  const rows = xs.map((x, i) => i).filter(i => within(xs[i]) && ys && known(ys[i]));
  if (rows.length < 3) return "";
  const values = rows.map(i => own.ys[i]), middle = mean(values), spread = rms(values.map(v => v - middle));
  return spread > 0 ? `: fit of the speed ${(100 * (1 - rms(rows.map(i => ys[i])) / spread)).toFixed(1)} %` : "";
}

// What can be an axis: every channel of a side and, but for the first, how far it is from that.
function axisOf(k, name) {
  if (name !== "difference") return coarse(k, name);
  return k ? there(k, 0, "speed").map((v, i) => v === null || !known(DATA.sides[k].columns.speed[i]) ? null : DATA.sides[k].columns.speed[i] - v) : undefined;
}

// A channel of side `other` at the samples of side k, by the clock.
function there(k, other, name) {
  const xs = clock(other), ys = coarse(other, name), hint = {i: 0};
  return clock(k).map(x => ys ? valueAt(xs, ys, x, hint) : null);
}

const xy = new Chart(byId("xy"), {height: 320});

function drawAgainst() {
  const k = Number(byId("xy-side").value), [nx, ny] = ["xy-x", "xy-y"].map(id => byId(id).value);
  const at = places(k), [xs, ys] = [axisOf(k, nx), axisOf(k, ny)];
  const rows = xs && ys ? at.map((_, i) => i).filter(i => within(at[i]) && known(xs[i]) && known(ys[i])) : [];
  const some = rows.filter((_, i) => i % Math.ceil(rows.length / MOST_DOTS || 1) === 0);
  const [px, py] = [some.map(i => xs[i]), some.map(i => ys[i])];
  const label = name => name === "difference" ? `difference of the speed from the first, ${DATA.speed_unit}` : LABELS[name] || name;
  xy.draw([{xs: px, ys: py, colour: COLOURS[k % COLOURS.length], dot: 3}], reach([px]), reach([py]), label(nx), label(ny));
  const pairs = rows.map(i => [xs[i], ys[i]]), r = pairs.length > 2 ? correlation(pairs) : NaN;
  byId("xy-says").textContent = rows.length ? `${rows.length} means of ${DATA.step_s} s${Number.isFinite(r) ? `, correlation ${r.toFixed(2)}` : ""}` : "not recorded together";
}

// Correlations of the difference in acceleration with every channel of the first side, the largest first.
function tellResidual() {
  const at = places(0), names = DATA.channels.map(c => c.name).filter(n => DATA.sides[0].native.columns[n] !== undefined);
  const ours = acceleration(DATA.sides[0].columns.speed);
  const columns = DATA.sides.slice(1).map((_, j) => {
    const theirs = acceleration(there(0, j + 1, "speed"));
    return ours.map((a, i) => known(a) && known(theirs[i]) ? theirs[i] - a : null);
  });
  const rows = names.map(name => {
    const values = coarse(0, name);
    return [name, columns.map(residual => {
      const pairs = at.map((_, i) => i).filter(i => within(at[i]) && known(residual[i]) && known(values[i])).map(i => [residual[i], values[i]]);
      return pairs.length > 20 ? correlation(pairs) : NaN;
    })];
  }).filter(([, found]) => found.some(Number.isFinite));
  const most = found => Math.max(...found.map(r => Number.isFinite(r) ? Math.abs(r) : 0));
  rows.sort((a, b) => most(b[1]) - most(a[1]));
  const cells = (kind, texts) => texts.map((text, i) => Object.assign(document.createElement(i ? kind : "th"), {textContent: text, className: i ? "n" : ""}));
  const row = (kind, texts) => { const tr = document.createElement("tr"); tr.append(...cells(kind, texts)); return tr; };
  byId("residual").replaceChildren(row("th", ["channel", ...DATA.sides.slice(1).map(s => s.name)]),
    ...rows.map(([name, found]) => row("td", [LABELS[name] || name, ...found.map(r => Number.isFinite(r) ? r.toFixed(2) : "")])));
}

// The rows that are to be left out, as options of a command.
function showKept() {
  const {begin_s: begin} = DATA.sides[0].native, name = DATA.sides[0].name.split("@").pop();
  byId("kept").hidden = !kept.length;
  byId("kept").querySelector("pre").textContent = kept.map(([a, b]) => `--without ${name}:${(begin + a).toFixed(1)}:${(begin + b).toFixed(1)}`).join(" ");
  byId("kept").querySelector("ul").replaceChildren(...kept.map(([a, b], i) => {
    const item = document.createElement("li"), button = document.createElement("button");
    button.textContent = "take back";
    button.type = "button";
    button.addEventListener("click", () => { kept.splice(i, 1); showKept(); draw(); });
    item.append(`${a.toFixed(1)} to ${b.toFixed(1)} s `, button);
    return item;
  }));
}

// Each pair of values at the same moment, by the clock: [the first side's, that of side k].
function together(k, ours, theirs) {
  const [x0, xk, hint] = [clock(0), clock(k), {i: 0}];
  return x0.map((x, i) => [ours[i], known(ours[i]) ? valueAt(xk, theirs, x, hint) : null]).filter(([a, b]) => known(a) && known(b));
}

const mean = values => values.reduce((a, b) => a + b, 0) / values.length;
const rms = values => Math.sqrt(mean(values.map(v => v * v)));

// Standard deviation of what the first side has in pairs.
function spread(pairs) {
  const middle = mean(pairs.map(p => p[0]));
  return rms(pairs.map(p => p[0] - middle));
}

function correlation(pairs) {
  const [a, b] = [0, 1].map(j => mean(pairs.map(p => p[j])));
  const sum = (f) => mean(pairs.map(f));
  return sum(p => (p[0] - a) * (p[1] - b)) / Math.sqrt(sum(p => (p[0] - a) ** 2) * sum(p => (p[1] - b) ** 2));
}

// The change of a speed at each moment, as the table has it; null next to what is unknown.
function acceleration(speed) {
  return speed.map((v, i) => {
    const [low, high] = [Math.max(i - 1, 0), Math.min(i + 1, speed.length - 1)];
    return [v, speed[low], speed[high]].every(known) && high > low ? (speed[high] - speed[low]) / ((high - low) * DATA.step_s * DATA.per_m_s) : null;
  });
}

// How far side k is off where it now lies, by the names of the numbers file.
function apart(k) {
  const [ours, theirs] = [0, k].map(side => DATA.sides[side].columns), pairs = together(k, ours.speed, theirs.speed);
  if (!pairs.length) return null;
  const off = p => p[1] - p[0], gaps = ours.gap && theirs.gap ? together(k, ours.gap, theirs.gap) : [];
  return {
    shared_s: pairs.length * DATA.step_s, speed_mean_m_s: mean(pairs.map(off)), speed_rms_m_s: rms(pairs.map(off)),
    speed_fit: spread(pairs) ? 100 * (1 - rms(pairs.map(off)) / spread(pairs)) : 0,
    acceleration_rms_m_s2: rms(together(k, acceleration(ours.speed), acceleration(theirs.speed)).map(off)),
    gap_rms_m: gaps.length ? rms(gaps.map(off)) : null, correlation: correlation(pairs),
  };
}

const ofSide = (selector, k) => [...document.querySelectorAll(selector)].filter(e => Number(e.dataset.side) === k);
const WRITTEN = new Map();  // what the page said before an offset was typed in

function write(element, text) {
  if (!WRITTEN.has(element)) WRITTEN.set(element, element.textContent);
  element.textContent = text ?? WRITTEN.get(element);
}

// All that is said of side k, for the offset that it now has; as it was written where that is the first one.
function tellApart(k) {
  const found = state.offsets[k] === DATA.sides[k].offset_s, now = found ? null : apart(k), name = DATA.sides[k].name;
  const [off, how, back] = ["h1 .off", ".how", ".back"].map(selector => ofSide(selector, k)[0]);
  const says = now ? `${name} is ${now.speed_rms_m_s.toPrecision(2)} ${DATA.speed_unit} off (rms over ${now.shared_s.toFixed(0)} s)` : `${name} has no time together with it`;
  const fits = now ? `correlation of the speeds ${now.correlation.toFixed(2)}` : "no time together";
  write(off, found ? null : says);
  write(how, found ? null : `by hand, from means of ${DATA.step_s} s; ${fits}`);
  for (const cell of ofSide("#apart td", k)) {
    const value = now && now[cell.dataset.number];
    write(cell, found ? null : known(value) ? `${Number(value.toPrecision(4))}` : "");
  }
  back.hidden = found;
  document.title = document.querySelector("h1").textContent.replace(/\.$/, "");
}

// What is typed is taken only where the sides then lie within reach of one another.
function typed(input) {
  const k = Number(input.dataset.side), value = Number(input.value);
  const long = side => DATA.sides[side].columns.speed.length * DATA.step_s;
  const fits = input.value !== "" && value > -long(k) && value < long(0);
  input.setAttribute("aria-invalid", `${!fits}`);
  if (!fits) {
    write(ofSide(".how", k)[0], `not moved: choose more than ${-Math.round(long(k))} and less than ${Math.round(long(0))} s, so that both have time together`);
    ofSide(".back", k)[0].hidden = false;
    return;
  }
  state.offsets[k] = value;
  tellApart(k);
  whole();
  draw();
}

// What is marked, in numbers: the mean of each side, and how far the others are from the first.
function described() {
  if (!state.mark) return "";
  const unit = state.by === "place" ? "m" : "s", [from, to] = state.mark;
  const inside = (xs, ys) => ys.filter((y, i) => known(y) && known(xs[i]) && xs[i] >= from && xs[i] <= to);
  const means = DATA.sides.map((side, k) => {
    const values = inside(places(k), side.columns.speed);
    if (!values.length) return `${side.name}: not there`;
    const off = k ? inside(places(0), difference(k, "speed") || []) : [];
    return `${side.name}: mean speed ${mean(values).toFixed(2)} ${DATA.speed_unit}${off.length ? `, off by ${rms(off).toFixed(2)} ${DATA.speed_unit} rms` : ""}`;
  });
  return `${from.toFixed(1)} to ${to.toFixed(1)} ${unit} marked. ${means.join("; ")}.`;
}

function build() {
  DATA.sides.forEach((side, k) => {
    const item = document.createElement("li"), stroke = document.createElement("i");
    stroke.style.borderTopColor = colour(k);
    stroke.style.borderTopStyle = k ? (k % 2 ? "dashed" : "dotted") : "solid";
    const text = document.createElement("span");
    text.textContent = side.name;
    item.append(stroke, text);
    byId("key").append(item);
  });
  for (const panel of DATA.panels) {
    addPanel(panel.meaning, panel.label, () => DATA.sides.map((_, k) => ({...line(k, panel.name), k})));
    if (panel.name === "speed") {
      addPanel("difference of the speeds from the first", `difference, ${DATA.speed_unit}`,
        () => DATA.sides.map((_, k) => k ? {...apartLine(k, "speed"), k} : {xs: [], ys: null, k}));
    }
  }
  const shared = DATA.sides.slice(1).some(s => s.place);
  byId("by").querySelector("[value=place]").disabled = !shared;
  byId("by").addEventListener("change", event => {
    [state.by, state.mark] = [event.target.value, null];
    whole();
    draw();
  });
  for (const input of document.querySelectorAll("#offsets input")) {
    input.addEventListener("input", () => typed(input));
  }
  for (const back of document.querySelectorAll(".back")) {
    back.addEventListener("click", () => {
      const [input] = ofSide("#offsets input", Number(back.dataset.side));
      input.value = DATA.sides[Number(back.dataset.side)].offset_s;
      typed(input);
    });
  }
  byId("zoom").addEventListener("click", () => {
    if (state.mark && state.mark[1] > state.mark[0]) state.window = [...state.mark];
    draw();
  });
  byId("whole").addEventListener("click", () => { whole(); draw(); });
  byId("clear").addEventListener("click", () => { state.mark = null; draw(); });
  byId("keep").addEventListener("click", () => {
    if (!state.mark || state.by !== "time") return;
    kept.push([...state.mark]);
    state.mark = null;
    showKept();
    draw();
  });
  const drawn = new Set(DATA.panels.map(p => p.name));
  for (const c of DATA.channels) if (!drawn.has(c.name)) byId("add").add(new Option(c.label, c.name));
  byId("add").addEventListener("change", event => {
    const found = DATA.channels.find(c => c.name === event.target.value);
    if (!found) return;
    addPanel(found.meaning, found.label, () => DATA.sides.map((_, k) => ({...line(k, found.name), k})));
    event.target.remove(event.target.selectedIndex);
    event.target.value = "";
    draw();
  });
  DATA.sides.forEach((side, k) => byId("xy-side").add(new Option(side.name, k)));
  byId("xy-side").value = DATA.sides.length - 1;
  for (const id of ["xy-x", "xy-y"]) {
    byId(id).add(new Option("difference of the speed from the first", "difference"));
    for (const c of DATA.channels) byId(id).add(new Option(c.label, c.name));
    byId(id).addEventListener("change", drawAgainst);
  }
  byId("xy-side").addEventListener("change", drawAgainst);
  byId("xy-x").value = "speed";
  byId("xy-y").value = "difference";
  window.addEventListener("resize", draw);
  whole();
  draw();
}

build();
