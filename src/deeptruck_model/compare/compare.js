// Panels of several drives over one axis: what is marked in one is marked in all, and given in numbers.
"use strict";

const DATA = JSON.parse(document.getElementById("drives").textContent);
const byId = id => document.getElementById(id);
const COLOURS = ["#222222", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9"];
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3], [4, 4], [1, 3]];
const colour = k => COLOURS[k % COLOURS.length], dash = k => DASHES[k % DASHES.length];

const state = {by: "time", offsets: DATA.sides.map(s => s.offset_s), mark: null, window: null};

// Where each sample of a side lies on the axis that is chosen; null where it lies nowhere.
function places(k) {
  const side = DATA.sides[k];
  if (state.by === "place") return side.place || side.columns.speed.map(() => null);
  return side.columns.speed.map((_, i) => state.offsets[k] + (i + 0.5) * DATA.step_s);
}

// The value of a line at x; null outside it, and beside what is unknown.
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
  const figure = document.createElement("figure"), canvas = document.createElement("canvas");
  const caption = document.createElement("figcaption");
  caption.textContent = title;
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${title}; arrow keys move what is marked`);
  figure.append(caption, canvas);
  byId("panels").append(figure);
  const plot = new Plot(canvas, 190);
  views.push({plot, label, lines, canvas});
  dragged(canvas, (from, to) => mark(plot.atX(from[0]), plot.atX(to[0])), (from, to) => {
    if (Math.abs(from[0] - to[0]) > 3) mark(plot.atX(from[0]), plot.atX(to[0]));
  });
  canvas.addEventListener("keydown", pressed);
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
  const axis = state.by === "place" ? "distance along the road, m" : "time, s";
  for (const {plot, label, lines} of views) {
    const drawn = lines().filter(line => line.ys);
    const inside = drawn.map(({xs, ys}) => ys.filter((_, i) => known(xs[i]) && xs[i] >= state.window[0] && xs[i] <= state.window[1]));
    plot.clear();
    plot.scale(state.window, reach(inside));
    plot.axes(axis, label);
    if (state.mark) plot.span(...state.mark, MARK, 0.15);
    for (const {xs, ys, k} of drawn) plot.line(xs, ys, colour(k), 1.5, dash(k));
  }
  byId("marked").textContent = described();
}

// Each pair of values at the same moment, by the clock: [the first side's, that of side k].
function together(k, ours, theirs) {
  const clock = side => DATA.sides[side].columns.speed.map((_, i) => state.offsets[side] + (i + 0.5) * DATA.step_s);
  const [x0, xk, hint] = [clock(0), clock(k), {i: 0}];
  return x0.map((x, i) => [ours[i], known(ours[i]) ? valueAt(xk, theirs, x, hint) : null]).filter(([a, b]) => known(a) && known(b));
}

const mean = values => values.reduce((a, b) => a + b, 0) / values.length;
const rms = values => Math.sqrt(mean(values.map(v => v * v)));

function correlation(pairs) {
  const [a, b] = [0, 1].map(j => mean(pairs.map(p => p[j])));
  const sum = (f) => mean(pairs.map(f));
  return sum(p => (p[0] - a) * (p[1] - b)) / Math.sqrt(sum(p => (p[0] - a) ** 2) * sum(p => (p[1] - b) ** 2));
}

// The change of a speed at each moment, as the table has it; null beside what is unknown.
function acceleration(speed) {
  return speed.map((v, i) => {
    const [low, high] = [Math.max(i - 1, 0), Math.min(i + 1, speed.length - 1)];
    return [v, speed[low], speed[high]].every(known) && high > low ? (speed[high] - speed[low]) / ((high - low) * DATA.step_s) : null;
  });
}

// How far side k is off where it now lies, by the names of the numbers file.
function apart(k) {
  const [ours, theirs] = [0, k].map(side => DATA.sides[side].columns), pairs = together(k, ours.speed, theirs.speed);
  if (!pairs.length) return null;
  const off = p => p[1] - p[0], gaps = ours.gap && theirs.gap ? together(k, ours.gap, theirs.gap) : [];
  return {
    shared_s: pairs.length * DATA.step_s, speed_mean_m_s: mean(pairs.map(off)), speed_rms_m_s: rms(pairs.map(off)),
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
  const says = now ? `${name} is ${now.speed_rms_m_s.toPrecision(2)} m/s off (rms over ${now.shared_s.toFixed(0)} s)` : `${name} has no time together with it`;
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
    return `${side.name}: mean speed ${mean(values).toFixed(2)} m/s${off.length ? `, off by ${rms(off).toFixed(2)} m/s rms` : ""}`;
  });
  return `${from.toFixed(1)} to ${to.toFixed(1)} ${unit} marked. ${means.join("; ")}.`;
}

function build() {
  DATA.sides.forEach((side, k) => {
    const item = document.createElement("li"), line = document.createElement("i");
    line.style.borderTopColor = colour(k);
    line.style.borderTopStyle = k ? (k % 2 ? "dashed" : "dotted") : "solid";
    item.append(line, side.name);
    byId("key").append(item);
  });
  for (const panel of DATA.panels) {
    addPanel(panel.meaning, panel.label, () => DATA.sides.map((s, k) => ({xs: places(k), ys: s.columns[panel.name], k})));
    if (panel.name === "speed") {
      addPanel("difference of the speeds from the first", "difference, m/s",
        () => DATA.sides.map((_, k) => ({xs: places(0), ys: k ? difference(k, "speed") : null, k})));
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
  window.addEventListener("resize", draw);
  whole();
  draw();
}

build();
