// The offending segment first: speed, force and one channel over time, of a drive that is chosen.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const shown = document.getElementById("data").dataset;
const drives = document.getElementById("drive"), channels = document.getElementById("channel");
const canvas = document.getElementById("strip"), plot = new Plot(canvas, 460);
const names = Object.keys(data.drives[0].channels);
data.drives.forEach((d, k) => drives.add(new Option(d.name, k)));
names.forEach(n => channels.add(new Option(data.labels[n] || n, n)));
const marks = [];  // rows that are to be left out; those of a page that is served alone
let view = null;

function within(d) {
  const [from, to] = view || [d.start, d.start + d.n * data.step];
  const a = Math.max(0, Math.floor((from - d.start) / data.step));
  const b = Math.min(d.n, Math.ceil((to - d.start) / data.step) + 1);
  return [a, Math.max(b, a + 2)];
}

function strip(d, a, b, from, to, columns, colours, label, last) {
  const t = Array.from({length: b - a}, (_, k) => d.start + (a + k) * data.step);
  const parts = columns.map(c => c.slice(a, b));
  plot.panel(from, to);
  plot.scale([t[0], t[t.length - 1]], reach(parts));
  data.segments.filter(s => s.drive === d.name).forEach(s => plot.span(s.from, s.to, "#e69f00", 0.18));
  data.events.filter(x => x.drive === d.name).forEach(x => plot.span(x.from, x.to, "#7b1fa2", 0.22));
  marks.filter(m => m.drive === d.name).forEach(m => plot.span(m.from, m.to, "#555555", 0.25));
  plot.axes(last ? "time, s" : "", label);
  parts.forEach((part, k) => plot.line(t, part, colours[k]));
}

function draw() {
  const d = data.drives[drives.value], [a, b] = within(d);
  plot.clear({bottom: 42});
  strip(d, a, b, 0.0, 0.28, [d.speed.map(v => v === null ? null : Number(shown.per) * v)], ["#222222"], `speed, ${shown.units}`);
  strip(d, a, b, 0.36, 0.64, data.found ? [d.residual, d.explained] : [d.residual], ["#999999", "#c2185b"], "missing, m/s²");
  strip(d, a, b, 0.72, 1.0, [d.channels[channels.value]], ["#0072b2"], data.labels[channels.value] || channels.value, true);
}

drives.onchange = () => { view = null; draw(); };
channels.onchange = draw;
canvas.ondblclick = () => { view = null; draw(); };
let began = null;
const at = e => {
  const d = data.drives[drives.value], [a, b] = within(d), box = canvas.getBoundingClientRect();
  const share = (e.clientX - box.left - 58) / Math.max(box.width - 78, 1);
  return d.start + (a + Math.min(Math.max(share, 0), 1) * (b - a)) * data.step;
};
canvas.onpointerdown = e => { began = at(e); };
canvas.onpointerup = e => {
  const ended = at(e);
  if (began !== null && Math.abs(ended - began) > 4 * data.step) { view = [Math.min(began, ended), Math.max(began, ended)]; draw(); }
  began = null;
};
window.onresize = draw;
if (data.first) {
  drives.value = data.drives.findIndex(d => d.name === data.first.drive);
  view = [data.first.from, data.first.to];
}
channels.value = data.channel;
draw();
