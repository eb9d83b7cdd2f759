// Panels of several drives over one axis: what is marked in one is marked in all, and told in numbers.
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
  byId("marked").textContent = told();
}

// What is marked, in numbers: the mean of each side, and how far the others are from the first.
function told() {
  if (!state.mark) return "";
  const unit = state.by === "place" ? "m" : "s", [from, to] = state.mark;
  const inside = (xs, ys) => ys.filter((y, i) => known(y) && known(xs[i]) && xs[i] >= from && xs[i] <= to);
  const means = DATA.sides.map((side, k) => {
    const values = inside(places(k), side.columns.speed);
    if (!values.length) return `${side.name}: not there`;
    const mean = values.reduce((a, b) => a + b, 0) / values.length;
    const off = k ? inside(places(0), difference(k, "speed") || []) : [];
    const rms = Math.sqrt(off.reduce((a, b) => a + b * b, 0) / off.length);
    return `${side.name}: mean speed ${mean.toFixed(2)} m/s${off.length ? `, off by ${rms.toFixed(2)} m/s rms` : ""}`;
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
    input.addEventListener("input", () => {
      const value = Number(input.value);
      if (input.value === "" || !Number.isFinite(value)) return;
      state.offsets[Number(input.dataset.side)] = value;
      whole();
      draw();
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
