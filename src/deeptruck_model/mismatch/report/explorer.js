// The offending segment first: speeds, force and one channel, over time or over another, of a drive that is chosen.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const shown = document.getElementById("data").dataset;
const part = id => document.getElementById(id);
const drives = part("drive"), channels = part("channel"), against = part("against");
const canvas = part("strip"), plot = new Plot(canvas, 480);
const names = Object.keys(data.labels), SPEEDS = ["speed", "simulated speed", "corrected speed"];
const COLOURS = ["#222222", "#d55e00", "#009e73"], LAGS_S = 10, BOUND = 2.58;  // of 99 % of uncorrelated noise
data.drives.forEach((d, k) => drives.add(new Option(d.name, k)));
let view = null, pointer = null;

const per = name => SPEEDS.includes(name) ? Number(shown.per) : 1;
const units = name => SPEEDS.includes(name) ? shown.units : data.units[name];
const label = name => data.labels[name] + (units(name) ? `, ${units(name)}` : "");
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

function strip(d, from, to, list, colours, says, last) {
  const parts = list.map(name => rows(d, name));
  plot.panel(from, to);
  plot.scale(reached(d), reach(parts.map(c => c.v)));
  data.segments.filter(s => s.drive === d.name).forEach(s => plot.span(s.from, s.to, "#e69f00", 0.18));
  data.events.filter(x => x.drive === d.name).forEach(x => plot.span(x.from, x.to, "#7b1fa2", 0.22));
  plot.axes(last ? "time, s" : "", says);
  parts.forEach((c, k) => plot.line(c.t, c.v, colours[k]));
  if (pointer !== null) plot.span(pointer, pointer, "#555555", 0.6);
}

function crossed(d, x, y) {
  const [, xs, ys] = together(d, [x, y]);
  plot.panel(0.75, 1.0);
  plot.scale(reach([xs]), reach([ys]));
  plot.axes(label(x), label(y));
  plot.dots(xs, ys, "#0072b2", 2);
}

// Percent, as control engineers say how well a model fits: 100 where it is exact, 0 where the mean is as good.
function fit(d, name) {
  const [, y, x] = together(d, ["speed", name]);
  const both = y.map((_, k) => k).filter(k => known(y[k]) && known(x[k]));
  if (both.length < 2) return "";
  const mean = both.reduce((s, k) => s + y[k], 0) / both.length, sum = of => both.reduce((s, k) => s + of(k) ** 2, 0);
  const off = sum(k => x[k] - y[k]), varies = sum(k => y[k] - mean);
  const share = varies > 0 ? `fits ${(100 * (1 - Math.sqrt(off / varies))).toFixed(1)} %, ` : "";
  return `${data.labels[name]} ${share}off by ${Math.sqrt(off / both.length).toPrecision(2)} ${shown.units} (rms)`;
}

function draw() {
  const d = data.drives[drives.value], speeds = SPEEDS.filter(n => d.columns[n]);
  const forces = ["missing", "explained"].filter(n => d.columns[n]);
  plot.clear({bottom: 42});
  strip(d, 0.0, 0.28, speeds, COLOURS, `speed, ${shown.units}`);
  strip(d, 0.34, 0.62, forces, ["#999999", "#c2185b"], "missing, m/s²", against.value !== "");
  if (against.value) crossed(d, against.value, channels.value);
  else strip(d, 0.72, 1.0, [channels.value], ["#0072b2"], label(channels.value), true);
  part("fit").textContent = speeds.slice(1).map(name => fit(d, name)).filter(text => text).join("; ");
  const t = pointer, list = [...new Set([...speeds, ...forces, channels.value])];
  part("cursor").textContent = t === null ? "" : `${t.toFixed(1)} s: ` + list.filter(n => at(d, n, t) !== null)
    .map(n => `${data.labels[n]} ${said(at(d, n, t), units(n))}`).join(", ");
  if (view) part("without").textContent = `--without ${quoted(d.name)}:${view[0].toFixed(1)}:${view[1].toFixed(1)}`;
  part("leave").hidden = !view;
  if (part("correlations").open) correlations(d);
}

const quoted = name => /^[\w./-]+$/.test(name) ? name : `'${name.replaceAll("'", "'\\''")}'`;

// Correlation of x with y that is so many rows later.
function correlation(x, y, lag) {
  let n = 0, sx = 0, sy = 0, xx = 0, yy = 0, xy = 0;
  for (let k = Math.max(0, -lag); k < x.length && k + lag < y.length; k++) {
    const a = x[k], b = y[k + lag];
    if (!known(a) || !known(b)) continue;
    n++; sx += a; sy += b; xx += a * a; yy += b * b; xy += a * b;
  }
  const both = Math.sqrt(Math.max(xx - sx * sx / n, 0) * Math.max(yy - sy * sy / n, 0));
  return both > 0 ? (xy - sx * sy / n) / both : null;
}

function correlations(d) {
  const lags = new Plot(part("lags"), 330), name = channels.value, [step, missing, other] = together(d, ["missing", name]);
  const most = Math.round(LAGS_S / step), bound = BOUND / Math.sqrt(Math.max(missing.filter(known).length, 1));
  const k = Array.from({length: 2 * most + 1}, (_, i) => i - most), t = k.map(i => i * step);
  const panel = (from, to, of, says, last) => {
    lags.panel(from, to);
    lags.scale([t[0], t[t.length - 1]], [-1, 1]);
    lags.axes(last ? "lag, s" : "", says);
    lags.band([t[0], t[t.length - 1]], [-bound, -bound], [bound, bound], "#999999");
    lags.line(t, k.map(of), "#0072b2");
  };
  lags.clear({bottom: 42});
  panel(0.0, 0.44, i => correlation(missing, missing, i), "missing, itself");
  panel(0.56, 1.0, i => correlation(other, missing, i), data.labels[name].slice(0, 22), true);
  const ranked = names.filter(n => n !== "missing" && n !== "explained" && !n.startsWith("part: ") && d.columns[n])
    .map(n => [n, correlation(...together(d, ["missing", n]).slice(1), 0)]).filter(([, r]) => r !== null)
    .sort((a, b) => Math.abs(b[1]) - Math.abs(a[1])).slice(0, 8);
  part("ranked").textContent = ranked.map(([n, r]) => `${data.labels[n]} ${r.toFixed(2)}`).join(", ");
}

let began = null, queued = false;
const time = e => {
  const [from, to] = reached(data.drives[drives.value]), box = canvas.getBoundingClientRect();
  const share = (e.clientX - box.left - 58) / Math.max(box.width - 78, 1);
  return from + Math.min(Math.max(share, 0), 1) * (to - from);
};
drives.onchange = () => { view = null; pointer = null; draw(); };
channels.onchange = against.onchange = draw;
part("correlations").ontoggle = draw;
canvas.ondblclick = () => { view = null; draw(); };
canvas.onpointerdown = e => { began = time(e); };
canvas.onpointermove = e => {
  pointer = time(e);
  if (!queued) requestAnimationFrame(() => { queued = false; draw(); });
  queued = true;
};
canvas.onpointerleave = () => { pointer = null; draw(); };
canvas.onpointerup = e => {
  const ended = time(e), least = 4 * (column(data.drives[drives.value], "speed").step);
  if (began !== null && Math.abs(ended - began) > least) { view = [Math.min(began, ended), Math.max(began, ended)]; draw(); }
  began = null;
};
window.onresize = draw;
if (data.first) {
  drives.value = data.drives.findIndex(d => d.name === data.first.drive);
  view = [data.first.from, data.first.to];
}
channels.value = data.channel;
draw();
