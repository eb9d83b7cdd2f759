// A canvas with axes: round ticks, a unit on each axis, lines, bands and dots in the units of the data.
"use strict";

const INK = "#222222", GREY = "#999999", GRID = "#e6e6e6", MARK = "#c2185b";
const FONT = '12px system-ui, "Segoe UI", "DejaVu Sans", sans-serif';

function known(x) { return x !== null && x !== undefined; }

// The least and the most of several columns, with a little room; [0, 1] where nothing is known.
function reach(columns, room = 0.04) {
  let low = Infinity, high = -Infinity;
  for (const column of columns) for (const v of column) if (known(v)) {
    if (v < low) low = v;
    if (v > high) high = v;
  }
  if (low > high) return [0, 1];
  const more = (high - low || 1) * room;
  return [low - more, high + more];
}

function ticks([low, high], most) {
  const raw = (high - low) / Math.max(most, 1), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(k => k * power).find(s => s >= raw * 0.999);
  const out = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(k * step);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const say = v => decimals < 5 ? v.toFixed(decimals) : v ? v.toExponential(1) : "0";
  return out.map(v => [v, say(Math.abs(v) < step / 2 ? 0 : v)]);
}

// Blue below zero, white at it, red above.
function tone(value, most) {
  const t = Math.max(-1, Math.min(1, value / most)), end = t > 0 ? [178, 24, 43] : [33, 102, 172];
  return `rgb(${end.map(c => Math.round(247 + (c - 247) * Math.abs(t))).join()})`;
}

class Plot {
  constructor(canvas, height) {
    this.canvas = canvas;
    this.height = height;
    this.pen = canvas.getContext("2d");
  }

  // Begin a drawing; margins in pixels.
  clear({left = 58, right = 20, top = 8, bottom = 38} = {}) {
    const ratio = window.devicePixelRatio || 1, width = Math.max(this.canvas.clientWidth, 120);
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.canvas.style.height = `${this.height}px`;
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.pen.font = FONT;
    this.outer = {left, top, right: width - right, bottom: this.height - bottom};
    this.panel(0, 1);
  }

  // Draw from now on in the part of the height from `from` to `to`, both shares of it.
  panel(from, to) {
    const o = this.outer, tall = o.bottom - o.top;
    this.box = {left: o.left, right: o.right, top: o.top + from * tall, bottom: o.top + to * tall};
  }

  scale(x, y, equal = false) {
    [this.x, this.y] = [x, y];
    if (!equal) return;
    const {left, right, top, bottom} = this.box;
    const per = Math.max((x[1] - x[0]) / (right - left), (y[1] - y[0]) / (bottom - top));
    const wide = (middle, pixels) => [middle - per * pixels / 2, middle + per * pixels / 2];
    this.x = wide((x[0] + x[1]) / 2, right - left);
    this.y = wide((y[0] + y[1]) / 2, bottom - top);
  }

  px(v) { return this.box.left + (v - this.x[0]) / (this.x[1] - this.x[0]) * (this.box.right - this.box.left); }
  py(v) { return this.box.bottom - (v - this.y[0]) / (this.y[1] - this.y[0]) * (this.box.bottom - this.box.top); }
  atX(p) { return this.x[0] + (p - this.box.left) / (this.box.right - this.box.left) * (this.x[1] - this.x[0]); }
  atY(p) { return this.y[0] + (this.box.bottom - p) / (this.box.bottom - this.box.top) * (this.y[1] - this.y[0]); }

  axes(xLabel, yLabel) {
    const {pen, box} = this;
    pen.lineWidth = 1;
    pen.strokeStyle = GRID;
    pen.fillStyle = INK;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const [v, text] of ticks(this.y, (box.bottom - box.top) / 24)) {
      this._stroke(box.left, this.py(v), box.right, this.py(v));
      pen.fillText(text, box.left - 5, this.py(v));
    }
    pen.textAlign = "center";
    pen.textBaseline = "top";
    for (const [v, text] of ticks(this.x, (box.right - box.left) / 55)) {
      this._stroke(this.px(v), box.top, this.px(v), box.bottom);
      if (xLabel) pen.fillText(text, this.px(v), box.bottom + 4);
    }
    if (xLabel) pen.fillText(xLabel, (box.left + box.right) / 2, box.bottom + 21);
    pen.save();
    pen.translate(9, (box.top + box.bottom) / 2);
    pen.rotate(-Math.PI / 2);
    pen.textBaseline = "middle";
    pen.fillText(yLabel, 0, 0);
    pen.restore();
  }

  _stroke(x0, y0, x1, y1) {
    this.pen.beginPath();
    this.pen.moveTo(x0, y0);
    this.pen.lineTo(x1, y1);
    this.pen.stroke();
  }

  _within(draw) {
    const {pen, box} = this;
    pen.save();
    pen.beginPath();
    pen.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
    pen.clip();
    draw(pen);
    pen.restore();
  }

  // A line with a gap wherever nothing is known.
  line(xs, ys, colour, width = 1.4, dash = []) {
    this._within(pen => {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.setLineDash(dash);
      pen.beginPath();
      let on = false;
      for (let i = 0; i < xs.length; i++) {
        if (!known(xs[i]) || !known(ys[i])) { on = false; continue; }
        if (on) pen.lineTo(this.px(xs[i]), this.py(ys[i]));
        else pen.moveTo(this.px(xs[i]), this.py(ys[i]));
        on = true;
      }
      pen.stroke();
    });
  }

  // Between two lines.
  band(xs, lows, highs, colour, alpha = 0.3) {
    this._within(pen => {
      pen.fillStyle = colour;
      pen.globalAlpha = alpha;
      for (let i = 0; i + 1 < xs.length; i++) {
        if (![lows[i], highs[i], lows[i + 1], highs[i + 1]].every(known)) continue;
        pen.beginPath();
        pen.moveTo(this.px(xs[i]), this.py(lows[i]));
        pen.lineTo(this.px(xs[i]), this.py(highs[i]));
        pen.lineTo(this.px(xs[i + 1]), this.py(highs[i + 1]));
        pen.lineTo(this.px(xs[i + 1]), this.py(lows[i + 1]));
        pen.fill();
      }
    });
  }

  // From one x to another, over the whole height.
  span(from, to, colour, alpha) {
    this._within(pen => {
      pen.fillStyle = colour;
      pen.globalAlpha = alpha;
      const wide = Math.max(this.px(to) - this.px(from), 1.5);
      pen.fillRect(this.px(from), this.box.top, wide, this.box.bottom - this.box.top);
    });
  }

  cell(x0, x1, y0, y1, colour) {
    this._within(pen => {
      pen.fillStyle = colour;
      pen.fillRect(this.px(x0), this.py(y1), this.px(x1) - this.px(x0) + 0.5, this.py(y0) - this.py(y1) + 0.5);
    });
  }

  // Dots; `colour` is one for all, or a function of their place in the column.
  dots(xs, ys, colour, size, which = () => true) {
    this._within(pen => {
      if (typeof colour === "string") pen.fillStyle = colour;
      for (let i = 0; i < xs.length; i++) {
        if (!known(xs[i]) || !known(ys[i]) || !which(i)) continue;
        if (typeof colour !== "string") pen.fillStyle = colour(i);
        pen.fillRect(this.px(xs[i]) - size / 2, this.py(ys[i]) - size / 2, size, size);
      }
    });
  }

  // The bar that shows which colour is which value.
  scaleBar(most, text) {
    const {pen, outer} = this, left = outer.right + 10, tall = outer.bottom - outer.top;
    for (let k = 0; k < tall; k++) {
      pen.fillStyle = tone(most * (1 - 2 * k / tall), most);
      pen.fillRect(left, outer.top + k, 8, 1.5);
    }
    pen.fillStyle = INK;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (const [v, said] of ticks([-most, most], 7)) {
      pen.fillText(said, left + 11, outer.top + tall / 2 * (1 - v / most));
    }
    pen.save();
    pen.translate(left + 42, (outer.top + outer.bottom) / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(text, 0, 0);
    pen.restore();
  }
}

// Tell `done` the corners of a rectangle that is dragged over a canvas, in its pixels; `moved` meanwhile, as often
// as the screen shows it.
function dragged(canvas, moved, done) {
  let from = null, to = null, waiting = false;
  const at = event => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("pointerdown", event => {
    if (event.button !== 0) return;
    from = at(event);
    if (event.isTrusted) canvas.setPointerCapture(event.pointerId);
  });
  const show = () => {
    waiting = false;
    if (from) moved(from, to);
  };
  canvas.addEventListener("pointermove", event => {
    if (!from) return;
    to = at(event);
    if (!waiting) requestAnimationFrame(show);
    waiting = true;
  });
  canvas.addEventListener("pointerup", event => {
    if (!from) return;
    const begun = from;
    from = null;
    done(begun, at(event));
  });
  canvas.addEventListener("pointercancel", () => { from = null; });
}
