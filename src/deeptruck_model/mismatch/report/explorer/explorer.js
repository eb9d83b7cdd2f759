// What is marked and chosen, and what follows from it: every view draws anew, and one line says it in numbers.
"use strict";

const RESIDUAL = "#2a9d84", EXPLAINED = "#882255";
const DATA = JSON.parse(document.getElementById("drives").textContent);
const byId = id => document.getElementById(id);

class State {
  constructor(changed) {
    this.drives = DATA.drives;
    this.findings = DATA.findings;
    this.changed = changed;
    this.marked = this.drives.map(d => new Uint8Array(d.columns.speed.length));
    this.axes = [...DATA.pair];
    this.chosen = null;
    this.usual = usualReach(this.drives);
    this.forceReach = [-DATA.reach, DATA.reach];
    this.whole();
  }

  whole() { this.window = this.drives.map(d => [d.start_s, d.start_s + d.columns.speed.length * DATA.block_s]); }

  unmark() { this.marked.forEach(m => m.fill(0)); }

  clear() {
    this.unmark();
    this.changed();
  }

  // Blocks that begin before `to` and end after `from` (s) in one drive; others stay as they are.
  addTime(index, from, to) {
    const at = t => (t - this.drives[index].start_s) / DATA.block_s;
    const first = Math.max(0, Math.floor(at(Math.min(from, to)) + 0.001));
    const last = Math.ceil(at(Math.max(from, to)) - 0.001);
    this.marked[index].fill(1, first, Math.max(last, first + 1));
  }

  markTime(index, from, to) {
    this.unmark();
    this.addTime(index, from, to);
    this.changed();
  }

  markWhere(inside) {
    this.drives.forEach((d, k) => this.marked[k].forEach((_, i) => { this.marked[k][i] = inside(d, i) ? 1 : 0; }));
    this.changed();
  }

  markSegments(segments) {
    this.unmark();
    segments.forEach(s => this.addTime(...s));
    this.changed();
  }

  // The marked stretches of a drive, s.
  runs(index) {
    const m = this.marked[index], out = [], begin = this.drives[index].start_s;
    for (let i = 0; i < m.length; i++) {
      if (!m[i]) continue;
      let end = i;
      while (end < m.length && m[end]) end++;
      out.push([begin + i * DATA.block_s, begin + end * DATA.block_s]);
      i = end;
    }
    return out;
  }

  span(index) {
    const runs = this.runs(index);
    return runs.length ? [runs[0][0], runs[runs.length - 1][1]] : null;
  }

  // Show what is marked, and a third of it on either side.
  zoom() {
    this.drives.forEach((d, k) => {
      const span = this.span(k);
      if (!span) return;
      const room = Math.max((span[1] - span[0]) / 3, 5), end = d.start_s + d.columns.speed.length * DATA.block_s;
      this.window[k] = [Math.max(d.start_s, span[0] - room), Math.min(end, span[1] + room)];
    });
    this.changed();
  }
}

function make(tag, text = "", attributes = {}) {
  const made = document.createElement(tag);
  made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

function digits(x) { return `${Number(x.toPrecision(3))}`; }

// What is marked, in numbers.
function said(state) {
  const columns = ["speed", "residual", "explained"], sums = {};
  let blocks = 0;
  const where = [];
  state.drives.forEach((d, k) => {
    const own = state.runs(k);
    if (own.length) where.push(own.length === 1 ? `${d.name} ${Math.round(own[0][0])} to ${Math.round(own[0][1])} s` : d.name);
    state.marked[k].forEach((on, i) => {
      if (!on) return;
      blocks++;
      for (const n of columns) if (d.columns[n] && known(d.columns[n][i])) {
        const sum = sums[n] = sums[n] || [0, 0];
        sum[0] += d.columns[n][i];
        sum[1]++;
      }
    });
  });
  if (!blocks) return "Nothing is marked. Drag over a drive or over any view; click to take the mark away.";
  const mean = n => digits(sums[n][0] / sums[n][1]);
  const parts = [`Marked: ${digits(blocks * DATA.block_s)} s in ${where.slice(0, 3).join(", ")}${where.length > 3 ? " and others" : ""}.`];
  if (sums.speed) parts.push(`Mean speed ${mean("speed")} m/s.`);
  if (sums.residual) parts.push(`Mean residual ${mean("residual")} ${DATA.unit}.`);
  if (sums.explained && DATA.explains) parts.push(`Of it explained ${mean("explained")} ${DATA.unit}.`);
  return parts.join(" ");
}

function timelines(state) {
  return state.drives.map((d, k) => {
    const name = d.name + (d.held_out ? ", held out" : "");
    const figure = make("figure"), canvas = make("canvas", "", {
      tabindex: "0", role: "slider", "aria-label": `${name}: the marked stretch. Arrow keys move it, with Shift its end.`,
      "aria-valuemin": d.start_s, "aria-valuemax": d.start_s + d.columns.speed.length * DATA.block_s, "aria-valuenow": d.start_s,
    });
    figure.append(make("figcaption", name), canvas);
    byId("timelines").append(figure);
    return new Timeline(state, k, canvas);
  });
}

function clouds(state) {
  const views = [new Track(state, byId("track"))];
  if (!DATA.unit) {
    for (const id of ["regime-view", "explained-view"]) byId(id).hidden = true;
    byId("track-says").textContent = views[0].onMap ? "Where it was driven." : "Speed along the distance.";
    return views;
  }
  if (!views[0].onMap) byId("track-says").textContent = "Residual along the drive: no positions were recorded.";
  if (!DATA.explains) byId("explained-says").textContent = "Residual against simulated acceleration: nothing is explained.";
  views.push(new Explained(state, byId("explained")));
  if (DATA.pair.length < 2) byId("regime-view").hidden = true;
  else views.push(new Regimes(state, byId("regime")));
  return views;
}

function axisChoices(state) {
  [["regime-x", 0], ["regime-y", 1]].forEach(([id, k]) => {
    const choice = byId(id);
    for (const [name, label] of Object.entries(DATA.axes)) choice.append(make("option", label, {value: name}));
    choice.value = state.axes[k];
    choice.addEventListener("change", () => {
      state.axes[k] = choice.value;
      state.changed();
    });
  });
}

function findingList(state) {
  state.findings.forEach((f, k) => {
    const button = make("button", `${f.name}, ${f.sure} sure`, {type: "button", "aria-pressed": "false"});
    button.style.borderLeftColor = f.colour;
    button.addEventListener("click", () => {
      choose(state, k);
      state.markSegments(f.segments);
    });
    byId("finding-list").append(button);
  });
  byId("finding-list").hidden = !state.findings.length;
}

// Where nothing of the mark is seen in the box of the drives, bring its first drive there.
function showMark(state) {
  const box = byId("timelines"), top = box.getBoundingClientRect().top, bottom = top + box.clientHeight;
  const marked = [...box.children].filter((_, k) => state.marked[k].some(on => on));
  const seen = figure => figure.getBoundingClientRect().bottom > top + 40 && figure.getBoundingClientRect().top < bottom - 40;
  if (marked.length && !marked.some(seen)) box.scrollTop += marked[0].getBoundingClientRect().top - top;
}

// Show a finding's curve and stretches.
function choose(state, k) {
  const f = state.findings[k];
  state.chosen = k;
  [...byId("finding-list").children].forEach((b, k) => b.setAttribute("aria-pressed", `${k === state.chosen}`));
  byId("chosen").hidden = false;
  byId("chosen-name").textContent = f.name;
  byId("curve").hidden = !f.curve;
  byId("curve-says").textContent = curveSays(f);
  segmentList(state, f);
}

function curveSays(f) {
  if (!f.force) return "It shows between two sensors and is no force.";
  if (!f.curve) return "Too little was driven to draw a curve of it.";
  const band = f.curve.low ? "Band: 95 % of its sizes, if the form is right." : "It has no band, as its form has no fitted sizes.";
  return `Line: the force of this finding. ${band} Points: what the drives show without the other findings, with two standard errors. `
    + `This variable alone tells ${f.curve.share} of how the force varies.`;
}

function segmentList(state, f) {
  const list = byId("segments");
  list.replaceChildren();
  byId("segments-head").hidden = !f.segments.length;
  f.segments.forEach(s => {
    const button = make("button", `${state.drives[s[0]].name} ${Math.round(s[1])} to ${Math.round(s[2])} s`, {type: "button"});
    button.addEventListener("click", () => {
      state.markSegments([s]);
      state.whole();
      state.zoom();
    });
    list.append(button);
  });
}

function errorTable() {
  const names = {before: "as given", parameters_only: "parameters refitted", after: "corrected"};
  byId("errors-head").hidden = !DATA.held_out.length;
  if (!DATA.held_out.length) return;
  const head = make("tr");
  head.append(make("th", "held-out drive"), ...Object.values(names).map(n => make("th", n, {class: "n"})));
  byId("held-out-errors").append(head);
  for (const row of DATA.held_out) {
    const line = make("tr");
    line.append(make("td", `${DATA.drives[row.drive].name} (${row.runs} ${row.runs === 1 ? "run" : "runs"})`));
    for (const n of Object.keys(names)) line.append(make("td", n in row.rms ? digits(row.rms[n]) : "", {class: "n"}));
    byId("held-out-errors").append(line);
  }
}

function start() {
  byId("explorer").hidden = false;
  for (const figures of document.querySelectorAll("details.print")) figures.open = false;
  let views = [];
  const state = new State(() => {
    const now = said(state);
    views.forEach(v => v.draw());
    byId("marked").textContent = now;
    views.filter(v => v instanceof Timeline).forEach(v => v.tell(now));
    showMark(state);
  });
  views = [...timelines(state), ...clouds(state), new Curve(state, byId("curve"))];
  axisChoices(state);
  findingList(state);
  errorTable();
  if (state.findings.length) choose(state, 0);
  byId("zoom").addEventListener("click", () => state.zoom());
  byId("whole").addEventListener("click", () => { state.whole(); state.changed(); });
  byId("unmark").addEventListener("click", () => state.clear());
  addEventListener("resize", () => state.changed());
  addEventListener("beforeprint", () => {
    for (const figures of document.querySelectorAll("details.print")) figures.open = true;
  });
  state.changed();
}

start();
