// Charts by uPlot: lines with gaps, dots, spans and bands, with a unit on each axis.
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

// Ticks with the decimals of their step.
function written(plot, ticks, axis, space, step) {
  const text = String(step), digits = text.includes("e-") ? 9 : (text.split(".")[1] || "").length;
  return ticks.map(v => Math.abs(v) < step / 2 ? "0" : digits < 5 ? v.toFixed(digits) : v.toExponential(1));
}

// Draws a series as squares of this size, px.
const dots = size => (plot, k) => {
  const fill = new Path2D(), [xs, ys] = plot.data[k], wide = size * devicePixelRatio;
  xs.forEach((x, i) => {
    if (!known(ys[i])) return;
    fill.rect(plot.valToPos(x, "x", true) - wide / 2, plot.valToPos(ys[i], "y", true) - wide / 2, wide, wide);
  });
  return {fill, stroke: null};
};

class Chart {
  // Charts of a `group` share their cursor. `marked(from, to)` is called for a segment that is dragged, `moved(x)` for
  // the cursor, with null where it leaves, and `under(chart)` to draw behind the lines. `time` writes a tick of x.
  constructor(where, {height, group, marked, moved, under, time, ink = INK, grid = GRID}) {
    Object.assign(this, {where, height, group, marked, moved, under, time, ink, grid});
  }

  // `lines`: {xs, ys, colour, width, dot}, where dots have a size, px; `x` and `y`: what is shown of the axes.
  draw(lines, x, y, xLabel, yLabel) {
    const width = Math.max(this.where.clientWidth, 120), shown = lines.length ? lines : [{xs: [], ys: [], colour: GREY}];
    const key = JSON.stringify([xLabel, yLabel, shown.map(({colour, width, dot}) => [colour, width, dot])]);
    const data = [null, ...shown.map(({xs, ys}) => {
      if (xs.every(known)) return [xs, ys];
      let last = xs.find(known) ?? 0;  // a gap where the place is not known
      return [xs.map(v => known(v) ? last = v : last), ys.map((v, i) => known(xs[i]) ? v : null)];
    })];
    if (key !== this.key) {
      if (this.plot) this.plot.destroy();
      this.plot = new uPlot(this._options(shown, width, xLabel, yLabel), data, this.where);
      this.key = key;
    }
    this.plot.batch(() => {
      if (width !== this.plot.width) this.plot.setSize({width, height: this.height});
      this.plot.setData(data, false);
      this.plot.setScale("x", {min: x[0], max: x[1]});
      this.plot.setScale("y", {min: y[0], max: y[1]});
    });
  }

  _options(lines, width, xLabel, yLabel) {
    const axis = {
      stroke: this.ink, font: FONT, labelFont: FONT, labelSize: 18, labelGap: 0, gap: 4, ticks: {show: false},
      grid: {stroke: this.grid, width: 1},
    };
    const line = ({colour, width = 1.4, dot}) => ({
      facets: [{scale: "x", auto: false}, {scale: "y", auto: false}],
      stroke: colour, fill: dot && colour, width, paths: dot ? dots(dot) : uPlot.paths.linear(), points: {show: false},
    });
    const {time, marked} = this;
    return {
      mode: 2, width, height: this.height, padding: [8, 12, 0, 0], legend: {show: false},
      scales: {x: {time: false, auto: false}, y: {auto: false}},
      axes: [{...axis, label: xLabel || undefined, size: 20, values: time ? (_, ticks) => ticks.map(time) : written},
        {...axis, label: yLabel, size: 46, values: written}],
      series: [null, ...lines.map(line)],
      cursor: {
        y: false, points: {show: false}, dataIdx: () => null, drag: {x: Boolean(marked), y: false, setScale: false},
        sync: this.group && {key: this.group, setSeries: false, filters: {pub: kind => /move|leave/.test(kind)}},
        bind: {dblclick: () => null},
      },
      hooks: {
        drawAxes: this.under ? [() => this.under(this)] : [],
        setCursor: this.moved ? [u => this.moved(u.cursor.left >= 0 ? u.posToVal(u.cursor.left, "x") : null)] : [],
        setSelect: marked ? [u => {
          const {left, width: wide} = u.select;
          u.setSelect({left: 0, top: 0, width: 0, height: 0}, false);
          if (wide > 3) marked(u.posToVal(left, "x"), u.posToVal(left + wide, "x"));
        }] : [],
        ready: [u => touched(u.over)],
      },
    };
  }

  // Fill from one x to another, over all of the height.
  span(from, to, colour, alpha) {
    const {ctx, bbox} = this.plot, at = v => this.plot.valToPos(v, "x", true);
    const left = Math.max(at(from), bbox.left), right = Math.min(at(to), bbox.left + bbox.width);
    if (right < left) return;
    Object.assign(ctx, {fillStyle: colour, globalAlpha: alpha});
    ctx.fillRect(left, bbox.top, Math.max(right - left, 1.5), bbox.height);
    ctx.globalAlpha = 1;
  }

  // Fill between two lines.
  band(xs, lows, highs, colour, alpha = 0.3) {
    const {ctx, bbox} = this.plot, px = v => this.plot.valToPos(v, "x", true), py = v => this.plot.valToPos(v, "y", true);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    Object.assign(ctx, {fillStyle: colour, globalAlpha: alpha});
    for (let i = 0; i + 1 < xs.length; i++) {
      if (![lows[i], highs[i], lows[i + 1], highs[i + 1]].every(known)) continue;
      ctx.beginPath();
      ctx.moveTo(px(xs[i]), py(lows[i]));
      ctx.lineTo(px(xs[i]), py(highs[i]));
      ctx.lineTo(px(xs[i + 1]), py(highs[i + 1]));
      ctx.lineTo(px(xs[i + 1]), py(lows[i + 1]));
      ctx.fill();
    }
    ctx.restore();
  }
}

// uPlot listens to a mouse only: a finger that is dragged sideways is one.
function touched(over) {
  over.style.touchAction = "pan-y";
  for (const kind of ["down", "move", "up"]) {
    over.addEventListener(`pointer${kind}`, ({pointerType, clientX, clientY}) => {
      if (pointerType === "touch") over.dispatchEvent(new MouseEvent(`mouse${kind}`, {clientX, clientY, bubbles: true}));
    });
  }
}
