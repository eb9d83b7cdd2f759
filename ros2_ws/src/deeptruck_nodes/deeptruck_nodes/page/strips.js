// Strips of the newest samples: a chart each, drawn at most as often as batches come.
"use strict";

const KEPT_MS = 61000;
const GAP_MS = 5000;  // beyond it two samples are not joined: a replay was moved
const BACK_MS = 1000;  // by which samples may come late; beyond it a replay was moved back

// Columns of times (ms) and values of a series; what is older than a minute is let go.
class Series {
  constructor() { this.t = []; this.v = []; }

  add(t, v) {
    for (let k = 0; k < t.length; k++) { this.t.push(t[k]); this.v.push(v[k]); }
  }

  // Where the last step back begins, of samples that follow those here; -1 where there is none.
  back(t) {
    let found = -1, last = this.t.length ? this.t[this.t.length - 1] : -Infinity;
    t.forEach((time, k) => { if (time < last - BACK_MS) found = k; last = time; });
    return found;
  }

  trim(before) {
    let k = 0;
    while (k < this.t.length && this.t[k] < before) k++;
    if (k > 500 || k === this.t.length) { this.t.splice(0, k); this.v.splice(0, k); }
  }

  last() { return this.v.length ? this.v[this.v.length - 1] : null; }
}

function tone(name) { return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(); }

class Strip {
  // `lines`: {series, says, tone, style}; `least`: how much the height shows at the least; `spans`: what is shaded.
  constructor(where, {says, unit, lines, least, spans = [], band = null, height = 130}) {
    Object.assign(this, {unit, lines, least, spans, band});
    this.figure = document.createElement("figure");
    this.caption = document.createElement("figcaption");
    this.figure.setAttribute("role", "img");
    this.figure.setAttribute("aria-label", `${says} over time, ${unit}`);
    this.values = lines.map(line => this._key(line.says, line.tone, line.style || ""));
    if (band) this._key(band.says, band.tone, "area");
    for (const span of spans) this._key(span.says, span.tone, "area");
    this.figure.append(this.caption);
    where.append(this.figure);
    const time = s => s ? `${s} s`.replace("-", "−") : "0 s", colour = name => () => tone(name);
    this.chart = new Chart(this.figure, {height, group: "run", under: () => this._under(), time, ink: colour("ink"), grid: colour("grid")});
  }

  _key(says, colour, style) {
    const item = document.createElement("span"), mark = document.createElement("i"), value = document.createElement("b");
    mark.className = style;
    if (style === "area") mark.style.background = `var(--${colour})`;
    else mark.style.borderColor = `var(--${colour})`;
    item.append(mark, `${says} `, value);
    this.caption.append(item);
    return value;
  }

  // `age` is how old the newest value of a series is, s, where it should be newer.
  draw(data, end, seconds, age = () => 0) {
    const from = end - seconds * 1000;
    this.lines.forEach((line, k) => {
      const v = data(line.series).last();
      const number = v === null ? "–" : `${v.toFixed(this.least < 1 ? 3 : 1).replace("-", "−")} ${this.unit}`;
      const old = v === null ? 0 : age(line.series), text = old ? `– (${number} ${old.toFixed(0)} s ago)` : number;
      if (this.values[k].textContent !== text) this.values[k].textContent = text;
    });
    this.shown = name => this._shown(data(name), end);
    const drawn = this.lines.map(({series, tone: name, style}) => ({
      ...this.shown(series), colour: tone(name), width: style === "thin" ? 1 : 1.8, dash: style === "dashed" ? [6, 4] : [],
    }));
    const more = this.band ? this.band.more() : 0, {xs, ys} = more ? this.shown("allowed") : {};
    for (const sign of more ? [-1, 1] : []) {  // the monitor's threshold beyond the simulator's uncertainty
      drawn.push({xs, ys: ys.map(v => v === null ? null : sign * (v + more)), colour: tone(this.band.tone), width: 1.2, dash: [2, 3]});
    }
    this.chart.draw(drawn, [-seconds, 0], this._reach(data, from), "", this.unit);
  }

  // A series over seconds before the end, with a gap where nothing came for GAP_MS.
  _shown({t, v}, end) {
    const xs = [], ys = [];
    t.forEach((time, k) => {
      if (k && time - t[k - 1] >= GAP_MS) { xs.push((time - end) / 1000); ys.push(null); }
      xs.push((time - end) / 1000);
      ys.push(v[k]);
    });
    return {xs, ys};
  }

  // What lies behind the lines: the simulator's uncertainty, and from each sample that is not zero to the next one, or
  // the second before it (`before`).
  _under() {
    for (const {series, tone: name, before} of this.spans) {
      const {xs, ys} = this.shown(series);
      xs.forEach((x, k) => {
        if (!ys[k]) return;
        if (before) this.chart.span(x - before / 1000, x, tone(name), 0.45, 8);
        else this.chart.span(x, k + 1 < xs.length ? Math.min(xs[k + 1], x + GAP_MS / 1000) : x, tone(name), 0.13);
      });
    }
    if (!this.band) return;
    const {xs, ys} = this.shown("allowed");
    this.chart.band(xs, ys.map(v => v === null ? null : -v), ys, tone(this.band.tone));
  }

  _reach(data, from) {
    let low = Infinity, high = -Infinity;
    const see = v => { if (v < low) low = v; if (v > high) high = v; };
    for (const {series} of this.lines) {
      const {t, v} = data(series);
      for (let k = t.length - 1; k >= 0 && t[k] >= from; k--) if (v[k] !== null) see(v[k]);
    }
    if (this.band) {
      see(0);
      const edge = data("allowed").last();
      if (edge !== null) { see(edge + this.band.more()); see(-edge - this.band.more()); }
    }
    if (low > high) [low, high] = [0, this.least];
    const room = Math.max((this.least - (high - low)) / 2, (high - low) * 0.06);
    return [low - room, high + room];
  }
}
