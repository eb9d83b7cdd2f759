// Strips of the newest samples: a canvas each, with a unit on both axes, drawn at most as often as batches come.
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

// Round places for ticks between two numbers.
function ticks(low, high, most) {
  const raw = (high - low) / Math.max(most, 1), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(k => k * power).find(s => s >= raw * 0.999);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), out = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    out.push([k * step, (k === 0 ? 0 : k * step).toFixed(decimals).replace("-", "−")]);
  }
  return out;
}

class Strip {
  // `lines`: {series, says, tone, style}; `least`: how much the height shows at the least; `spans`: what is shaded.
  constructor(where, {says, unit, lines, least, spans = [], band = null, height = 130}) {
    Object.assign(this, {says, unit, lines, least, spans, band, height});
    this.figure = document.createElement("figure");
    this.caption = document.createElement("figcaption");
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${says} over time, ${unit}`);
    this.values = lines.map(line => this._key(line.says, line.tone, line.style || ""));
    if (band) this._key(band.says, band.tone, "area");
    for (const span of spans) this._key(span.says, span.tone, "area");
    this.figure.append(this.caption, this.canvas);
    where.append(this.figure);
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
    this._begin(this._reach(data, from));
    const x = t => this.left + (t - from) / (seconds * 1000) * (this.right - this.left);
    this._axes(x, end, seconds);
    this.pen.save();
    this.pen.beginPath();
    this.pen.rect(this.left, this.top, this.right - this.left, this.bottom - this.top);
    this.pen.clip();
    for (const span of this.spans) this._shade(data(span.series), x, span);
    if (this.band) this._band(data, x);
    for (const line of this.lines) this._line(data(line.series), x, from, line);
    this.pen.restore();
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

  _begin([low, high]) {
    const ratio = window.devicePixelRatio || 1, width = Math.max(this.canvas.clientWidth, 200);
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.canvas.style.height = `${this.height}px`;
    this.pen = this.canvas.getContext("2d");
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.pen.font = '12px system-ui, "Segoe UI", "DejaVu Sans", sans-serif';
    [this.left, this.right, this.top, this.bottom] = [62, width - 12, 6, this.height - 20];
    [this.low, this.high] = [low, high];
  }

  y(v) { return this.bottom - (v - this.low) / (this.high - this.low) * (this.bottom - this.top); }

  _axes(x, end, seconds) {
    const pen = this.pen;
    pen.strokeStyle = tone("grid");
    pen.fillStyle = tone("ink");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const [v, text] of ticks(this.low, this.high, 4)) {
      this._rule(this.left, this.y(v), this.right, this.y(v));
      pen.fillText(text, this.left - 5, this.y(v));
    }
    pen.textBaseline = "top";
    for (let s = 0; s <= seconds; s += seconds / 5) {
      const at = x(end - s * 1000);
      this._rule(at, this.top, at, this.bottom);
      pen.textAlign = s === 0 ? "right" : "center";
      pen.fillText(s ? `−${s} s` : "0 s", s ? at : this.right, this.bottom + 4);
    }
    pen.save();
    pen.translate(9, (this.top + this.bottom) / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(this.unit, 0, 0);
    pen.restore();
  }

  _rule(x0, y0, x1, y1) {
    this.pen.beginPath();
    this.pen.moveTo(x0, y0);
    this.pen.lineTo(x1, y1);
    this.pen.stroke();
  }

  _line({t, v}, x, from, line) {
    const pen = this.pen;
    pen.strokeStyle = tone(line.tone);
    pen.lineWidth = line.style === "thin" ? 1 : 1.8;
    pen.setLineDash(line.style === "dashed" ? [6, 4] : []);
    pen.beginPath();
    let on = false;
    for (let k = 0; k < t.length; k++) {
      if (t[k] < from - 2000) continue;
      if (v[k] === null) { on = false; continue; }
      if (on && t[k] - t[k - 1] < GAP_MS) pen.lineTo(x(t[k]), this.y(v[k]));
      else pen.moveTo(x(t[k]), this.y(v[k]));
      on = true;
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  // Shade from one sample that is not zero to the next sample, or the second before it (`before`).
  _shade({t, v}, x, {tone: colour, before}) {
    this.pen.fillStyle = tone(colour);
    this.pen.globalAlpha = before ? 0.45 : 0.13;
    for (let k = 0; k < t.length; k++) {
      if (!v[k]) continue;
      const begin = before ? t[k] - before : t[k];
      const until = before || k + 1 === t.length ? t[k] : Math.min(t[k + 1], t[k] + GAP_MS);
      const top = before ? this.bottom - 8 : this.top;
      this.pen.fillRect(x(begin), top, Math.max(x(until) - x(begin), 1), this.bottom - top);
    }
    this.pen.globalAlpha = 1;
  }

  // The simulator's uncertainty, filled; with the monitor's threshold beyond it, dotted.
  _band(data, x) {
    const {t, v} = data("allowed"), pen = this.pen, more = this.band.more();
    pen.fillStyle = pen.strokeStyle = tone(this.band.tone);
    pen.globalAlpha = 0.3;
    for (let k = 0; k + 1 < t.length; k++) {
      if (v[k] === null || v[k + 1] === null) continue;
      pen.beginPath();
      pen.moveTo(x(t[k]), this.y(v[k]));
      pen.lineTo(x(t[k + 1]), this.y(v[k + 1]));
      pen.lineTo(x(t[k + 1]), this.y(-v[k + 1]));
      pen.lineTo(x(t[k]), this.y(-v[k]));
      pen.fill();
    }
    pen.globalAlpha = 1;
    pen.lineWidth = 1.2;
    pen.setLineDash([2, 3]);
    for (const sign of more ? [-1, 1] : []) {
      pen.beginPath();
      let on = false;
      for (let k = 0; k < t.length; k++) {
        if (v[k] === null) { on = false; continue; }
        const at = this.y(sign * (v[k] + more));
        if (on) pen.lineTo(x(t[k]), at); else pen.moveTo(x(t[k]), at);
        on = true;
      }
      pen.stroke();
    }
    pen.setLineDash([]);
  }
}
