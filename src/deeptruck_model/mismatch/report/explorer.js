// The offending segment first: speeds, force and one channel, over time or over another, of a drive that is chosen.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const shown = document.getElementById("data").dataset;
const part = id => document.getElementById(id);
const drives = part("drive"), channels = part("channel"), against = part("against");
const names = Object.keys(data.units), SPEEDS = ["speed", "simulated speed", "corrected speed"];
const COLOURS = ["#222222", "#d55e00", "#009e73"];
data.drives.forEach((d, k) => drives.add(new Option(d.name, k)));
let view = null, chosen = null, pointer = null;  // `chosen`: the view that the reader dragged

const per = name => SPEEDS.includes(name) ? Number(shown.per) : 1;
const units = name => SPEEDS.includes(name) ? shown.units : data.units[name];
const spoken = name => name.replaceAll("_", " ");
const label = name => spoken(name) + (units(name) ? `, ${units(name)}` : "");
names.forEach(n => channels.add(new Option(label(n), n)));
against.add(new Option("time, s", ""));
names.forEach(n => against.add(new Option(label(n), n)));

// A column as numbers, null where nothing is known; decoded when it is first drawn.
function column(d, name) {
  const c = d.columns[name];
  if (!c) return {step: d.seconds, v: [null]};
  if (!c.v) {
    const raw = atob(c.codes);
    c.v = Array.from({length: raw.length / 2}, (_, k) => {
      const code = raw.charCodeAt(2 * k) | raw.charCodeAt(2 * k + 1) << 8;
      return code === 65535 ? null : per(name) * (c.low + c.by * code);
    });
  }
  return c;
}

const reached = d => view || [d.start, d.start + d.seconds];

// The rows of a column within the view, with their times.
function rows(d, name) {
  const {step, v} = column(d, name), [from, to] = reached(d);
  const a = Math.max(0, Math.floor((from - d.start) / step)), b = Math.min(v.length, Math.ceil((to - d.start) / step) + 1);
  return {step, v: v.slice(a, b), t: Array.from({length: Math.max(b - a, 0)}, (_, k) => d.start + (a + k) * step)};
}

// Several columns by rows of the longest of their steps.
function together(d, list) {
  const step = Math.max(...list.map(name => column(d, name).step));
  return [step, ...list.map(name => {
    const c = rows(d, name), n = Math.max(1, Math.round(step / c.step)), out = [];
    for (let k = 0; k + n <= c.v.length; k += n) {
      const some = c.v.slice(k, k + n).filter(known);
      out.push(some.length ? some.reduce((x, y) => x + y) / some.length : null);
    }
    return out;
  })];
}

function at(d, name, t) {
  const {step, v} = column(d, name), value = v[Math.round((t - d.start) / step)];
  return known(value) ? value : null;
}

function said(value, unit) {
  return `${Number(value.toFixed(3))}${unit ? ` ${unit}` : ""}`;
}

const under = chart => {
  const d = data.drives[drives.value];
  data.segments.filter(s => s.drive === d.name).forEach(s => chart.span(s.from, s.to, "#e69f00", 0.18));
  data.events.filter(x => x.drive === d.name).forEach(x => chart.span(x.from, x.to, "#7b1fa2", 0.22));
};
const strips = [150, 150, 170].map(height => new Chart(part("strip"), {height, group: "drive", under, marked, moved}));
const cross = new Chart(part("cross"), {height: 240});

function strip(chart, d, list, colours, says) {
  const parts = list.map(name => rows(d, name));
  chart.draw(parts.map((c, k) => ({xs: c.t, ys: c.v, colour: colours[k]})), reached(d), reach(parts.map(c => c.v)), "time, s", says);
}

// Percent, as control engineers say how well a model fits: 100 where it is exact, 0 where the mean is as good.
function fit(d, name) {
  const [, y, x] = together(d, ["speed", name]);
  const both = y.map((_, k) => k).filter(k => known(y[k]) && known(x[k]));
  if (both.length < 2) return "";
  const mean = both.reduce((s, k) => s + y[k], 0) / both.length, sum = of => both.reduce((s, k) => s + of(k) ** 2, 0);
  const off = sum(k => x[k] - y[k]), varies = sum(k => y[k] - mean);
  const share = varies > 0 ? `fits ${(100 * (1 - Math.sqrt(off / varies))).toFixed(1)} %, ` : "";
  return `${spoken(name)} ${share}off by ${Math.sqrt(off / both.length).toPrecision(2)} ${shown.units} (rms)`;
}

function draw() {
  const d = data.drives[drives.value], speeds = SPEEDS.filter(n => d.columns[n]);
  const forces = ["missing", "explained"].filter(n => d.columns[n]);
  strip(strips[0], d, speeds, COLOURS, `speed, ${shown.units}`);
  strip(strips[1], d, forces, [GREY, MARK], "missing, m/s²");
  strip(strips[2], d, [channels.value], ["#0072b2"], label(channels.value));
  part("cross").hidden = !against.value;
  if (against.value) {
    const [, xs, ys] = together(d, [against.value, channels.value]);
    cross.draw([{xs, ys, colour: "#0072b2", dot: 3}], reach([xs]), reach([ys]), label(against.value), label(channels.value));
  }
  part("fit").textContent = speeds.slice(1).map(name => fit(d, name)).filter(text => text).join("; ");
  if (view) part("without").textContent = `--without ${quoted(d.name)}:${view[0].toFixed(1)}:${view[1].toFixed(1)}`;
  const fault = !view || data.segments.some(x => x.drive === d.name && x.from < view[1] && x.to > view[0]);
  part("leave").hidden = fault || chosen !== view;  // rows in which a finding acts are what it was found by
}

const quoted = name => /^[\w./-]+$/.test(name) ? name : `'${name.replaceAll("'", "'\\''")}'`;

let queued = false;

function moved(t) {
  pointer = t;
  if (!queued) requestAnimationFrame(() => { queued = false; tell(); });
  queued = true;
}

// The values at the cursor.
function tell() {
  const d = data.drives[drives.value], t = pointer, all = [...SPEEDS, "missing", "explained", channels.value];
  const list = [...new Set(all)].filter(n => d.columns[n] && t !== null && at(d, n, t) !== null);
  part("cursor").textContent = t === null ? "" : `${t.toFixed(1)} s: ${list.map(n => `${spoken(n)} ${said(at(d, n, t), units(n))}`).join(", ")}`;
}

function marked(from, to) {
  if (to - from <= 4 * column(data.drives[drives.value], "speed").step) return;
  view = chosen = [from, to];
  draw();
}

drives.onchange = () => { view = null; draw(); };
channels.onchange = against.onchange = draw;
part("strip").ondblclick = () => { view = null; draw(); };
window.onresize = draw;
if (data.first) {
  drives.value = data.drives.findIndex(d => d.name === data.first.drive);
  view = [data.first.from, data.first.to];
}
channels.value = data.channel;
draw();
