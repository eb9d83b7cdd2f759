// The linked views. Each draws all drives, and over them what is marked.
"use strict";

const CELLS = 14, LEAST_S = 3, DEGREE_KM = 111.2;

function blockTimes(drive) {
  return drive.columns.speed.map((_, i) => drive.start_s + (i + 0.5) * DATA.block_s);
}

function everywhere(drives, name) { return drives.map(d => d.columns[name] || []); }

// What a view colours by: nearly the largest residual, so that one spike does not make all else pale.
function usualReach(drives) {
  const sizes = everywhere(drives, "residual").flat().filter(known).map(Math.abs).sort((a, b) => a - b);
  return sizes.length ? Math.max(sizes[Math.floor(0.98 * (sizes.length - 1))], 1e-3) : 1;
}

// A spike stands at the edge of what shows forces, where it can be marked.
function withinReach(forces) {
  return forces.map(v => known(v) ? Math.max(-DATA.reach, Math.min(DATA.reach, v)) : v);
}

// One drive along time: speed above, residual and explained force below.
class Timeline {
  constructor(state, index, canvas) {
    Object.assign(this, {state, index, drive: state.drives[index]});
    this.times = blockTimes(this.drive);
    this.plot = new Plot(canvas, this.drive.columns.residual ? 236 : 120);
    this.listen(canvas);
  }

  listen(canvas) {
    const marked = (from, to) => this.state.markTime(this.index, this.plot.atX(from[0]), this.plot.atX(to[0]));
    dragged(canvas, marked, (from, to) => {
      if (Math.abs(to[0] - from[0]) < 3) this.state.clear();
      else marked(from, to);
    });
    canvas.addEventListener("keydown", event => this.key(event));
  }

  key(event) {
    const {state} = this, [low, high] = state.window[this.index];
    const step = (high - low) / 40;
    let [from, to] = state.span(this.index) || [low, low + 2 * step];
    const by = {ArrowLeft: -step, ArrowRight: step}[event.key];
    if (event.key === "Escape") state.clear();
    else if (by === undefined) return;
    else if (event.shiftKey) state.markTime(this.index, from, Math.max(to + by, from + DATA.block_s));
    else state.markTime(this.index, from + (state.span(this.index) ? by : 0), to + (state.span(this.index) ? by : 0));
    event.preventDefault();
  }

  // What a screen reader says of it.
  tell(text) {
    const [from] = this.state.span(this.index) || [this.drive.start_s];
    this.plot.canvas.setAttribute("aria-valuenow", from);
    this.plot.canvas.setAttribute("aria-valuetext", text);
  }

  draw() {
    const {plot, state, drive} = this, c = drive.columns, window = state.window[this.index];
    plot.clear();
    const forces = c.residual !== undefined;
    if (forces) plot.panel(0, 0.33);
    this.panel(window, reach([c.speed.concat([0])]), forces ? "" : "time, s", "speed, m/s");
    plot.line(this.times, c.speed, INK);
    if (!forces) return;
    plot.panel(0.41, 1);
    this.panel(window, state.forceReach, "time, s", `force, ${DATA.unit}`);
    plot.line(window, [0, 0], GREY, 0.8);
    plot.band(this.times, c.low, c.high, RESIDUAL, 0.3);
    plot.line(this.times, c.residual, RESIDUAL, 2.2);
    if (DATA.explains) plot.line(this.times, c.explained, EXPLAINED, 1.2);
    const own = c[`force${state.chosen}`];
    if (own) plot.line(this.times, own, state.findings[state.chosen].colour, 1.6, [5, 3]);
  }

  panel(x, y, xLabel, yLabel) {
    const {plot, state} = this;
    plot.scale(x, y);
    plot.axes(xLabel, yLabel);
    state.findings.forEach(f => f.segments.filter(s => s[0] === this.index)
      .forEach(s => plot.span(s[1], s[2], f.colour, 0.18)));
    for (const [from, to] of state.runs(this.index)) plot.span(from, to, MARK, 0.22);
  }
}

// A view of all drives at once, as dots. `columns` gives x and y of a drive.
class Cloud {
  constructor(state, canvas) {
    Object.assign(this, {state, plot: new Plot(canvas, 290)});
    const marked = (from, to) => {
      const xs = [from[0], to[0]].map(p => this.plot.atX(p)).sort((a, b) => a - b);
      const ys = [from[1], to[1]].map(p => this.plot.atY(p)).sort((a, b) => a - b);
      state.markWhere((d, i) => {
        const [x, y] = this.columns(d);
        return known(x[i]) && known(y[i]) && x[i] >= xs[0] && x[i] <= xs[1] && y[i] >= ys[0] && y[i] <= ys[1];
      });
    };
    dragged(canvas, marked, (from, to) => {
      if (Math.hypot(to[0] - from[0], to[1] - from[1]) < 3) state.clear();
      else marked(from, to);
    });
  }

  drawMarks(size = 4) {
    this.state.drives.forEach((d, k) => {
      const [x, y] = this.columns(d);
      this.plot.dots(x, y, MARK, size, i => this.state.marked[k][i]);
    });
  }

  ends(k) { return reach(this.state.drives.map(d => this.columns(d)[k])); }
}

// Where it was driven, coloured by the residual; without positions, the residual along the distance.
class Track extends Cloud {
  constructor(state, canvas) {
    super(state, canvas);
    this.onMap = state.drives.every(d => d.columns.latitude);
    this.centre = ["latitude", "longitude"].map(n => {
      const [low, high] = reach(everywhere(state.drives, n), 0);
      return (low + high) / 2;
    });
    this.places = new Map(state.drives.map(d => [d, this.onMap ? this.place(d) : this.along(d)]));
  }

  place(d) {
    const [north, east] = this.centre, per = DEGREE_KM * Math.cos(north * Math.PI / 180);
    return [
      d.columns.longitude.map(v => known(v) ? (v - east) * per : null),
      d.columns.latitude.map(v => known(v) ? (v - north) * DEGREE_KM : null),
    ];
  }

  along(d) {
    return [d.columns.distance, d.columns.residual ? withinReach(d.columns.residual) : d.columns.speed];
  }

  columns(d) { return this.places.get(d); }

  draw() {
    const {plot, state} = this, coloured = this.onMap && DATA.unit;
    plot.clear({right: coloured ? 62 : 20});
    plot.scale(this.ends(0), this.ends(1), this.onMap);
    if (this.onMap) plot.axes("east of the middle, km", "north of the middle, km");
    else plot.axes("distance along the drive, km", DATA.unit ? `residual, ${DATA.unit}` : "speed, m/s");
    const most = state.usual;
    for (const d of state.drives) {
      const [x, y] = this.columns(d), r = d.columns.residual;
      if (coloured) plot.dots(x, y, "#b9c0c6", 5.5);  // a rim, as what is near zero is white
      plot.dots(x, y, coloured ? i => known(r[i]) ? tone(r[i], most) : "#dddddd" : "#5b7894", coloured ? 3.5 : 2.4);
    }
    this.drawMarks();
    if (coloured) plot.scaleBar(most, `residual, ${DATA.unit}`);
  }
}

// Mean residual in cells of two signals of the driving.
class Regimes extends Cloud {
  columns(d) { return this.state.axes.map(n => d.columns[n]); }

  draw() {
    const {plot, state} = this, x = this.ends(0), y = this.ends(1);
    plot.clear({right: 62});
    plot.scale(x, y);
    plot.axes(DATA.axes[state.axes[0]], DATA.axes[state.axes[1]]);
    const cells = this.cells(x, y), most = Math.max(...cells.map(c => Math.abs(c.mean)), 1e-3);
    const wide = (x[1] - x[0]) / CELLS, tall = (y[1] - y[0]) / CELLS;
    for (const c of cells) {
      plot.cell(x[0] + c.i * wide, x[0] + (c.i + 1) * wide, y[0] + c.j * tall, y[0] + (c.j + 1) * tall,
        tone(c.mean, most));
    }
    this.drawMarks(3);
    plot.scaleBar(most, `mean residual, ${DATA.unit}`);
  }

  cells(x, y) {
    const sums = new Map(), at = (v, [low, high]) => Math.min(CELLS - 1, Math.floor((v - low) / (high - low) * CELLS));
    for (const d of this.state.drives) {
      const [a, b] = this.columns(d), r = d.columns.residual;
      r.forEach((v, i) => {
        if (!known(v) || !known(a[i]) || !known(b[i])) return;
        const key = at(a[i], x) * CELLS + at(b[i], y), sum = sums.get(key) || [0, 0];
        sums.set(key, [sum[0] + v, sum[1] + 1]);
      });
    }
    return [...sums].filter(([, [, n]]) => n * DATA.block_s >= LEAST_S)
      .map(([key, [sum, n]]) => ({i: Math.floor(key / CELLS), j: key % CELLS, mean: sum / n}));
  }
}

// Residual against what the findings explain; where they explain nothing, against the simulated acceleration.
class Explained extends Cloud {
  columns(d) {
    return [DATA.explains ? d.columns.explained : d.columns.simulated, withinReach(d.columns.residual)];
  }

  draw() {
    const {plot, state} = this, x = this.ends(0);
    plot.clear();
    plot.scale(x, this.ends(1));
    plot.axes(DATA.explains ? `explained force, ${DATA.unit}` : "simulated acceleration, m/s²",
      `residual, ${DATA.unit}`);
    for (const d of state.drives) plot.dots(...this.columns(d), "#5b7894", 2.4);
    plot.line(x, DATA.explains ? x : [0, 0], INK, 1, [5, 3]);
    this.drawMarks();
  }
}

// The curve of the chosen finding, its band, and what the drives show.
class Curve {
  constructor(state, canvas) { Object.assign(this, {state, plot: new Plot(canvas, 260)}); }

  draw() {
    const {plot, state} = this, f = state.findings[state.chosen], c = f && f.curve;
    if (!c) return;
    const tops = c.seen.map((v, i) => v + c.error[i]), lows = c.seen.map((v, i) => v - c.error[i]);
    plot.clear();
    plot.scale(reach([c.x]), reach([c.force, tops, lows, c.low || [], c.high || [], [0]]));
    plot.axes(c.by, `force, ${DATA.unit}`);
    plot.line(plot.x, [0, 0], GREY, 0.8);
    if (c.low) plot.band(c.x, c.low, c.high, f.colour, 0.35);
    plot.line(c.x, c.force, f.colour, 2.2);
    c.x.forEach((x, i) => plot.line([x, x], [lows[i], tops[i]], INK, 1.2));
    plot.dots(c.x, c.seen, INK, 5);
  }
}
