// The live page: ten times a second it receives the state of the run, and the samples that came since.
"use strict";

const $ = id => document.getElementById(id);
const tone = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const SHOWN_S = 30;
const OLD_S = 1;  // beyond it a value is no present one, and two samples are not joined by a line
const SILENT_S = 3;  // beyond it a node, which reports once a second, says nothing
const QUIET_MS = 2000;  // without a word from the server, which speaks ten times a second
const GLYPHS = {ok: "✓", warn: "▲", error: "✖", silent: "○"};
const FAILED = / failed$|^it never began$|^not everything got ready$/;  // ends that nobody planned
const STRIPS = [
  {title: "Speed", unit: "m/s", least: 1, lines: {speed: "truck", leader_speed: "leader by radar"}},
  {title: "Gap", unit: "m", least: 2, lines: {gap: "by radar"}},
  {title: "Engine command", least: 2, lines: {engine_command: "command"}},
  {title: "Brake command", least: 2, lines: {brake_command: "command"}},
];

let state = null, series = {}, strips = [], heardAt = performance.now(), moving = false;

const samples = name => series[name] || (series[name] = {t: [], v: []});

function write(id, text, kind = "") {
  const where = $(id);
  if (where.textContent !== text) where.textContent = text;
  if (where.className !== kind) where.className = kind;
}

// Lines of a list, each a kind and a text.
function list(id, rows) {
  const key = JSON.stringify(rows), where = $(id);
  if (where.dataset.key === key) return;
  where.dataset.key = key;
  where.replaceChildren(...rows.map(([className, textContent]) => Object.assign(document.createElement("li"), {className, textContent})));
}

// How old the newest sample of a series is, s.
function age(name) {
  const {t} = samples(name);
  return t.length ? (state.now - t[t.length - 1]) / 1000 : 0;
}

class Strip {
  // `least`: how much the height shows at the least.
  constructor({title, unit, least, lines}) {
    const names = Object.keys(lines), given = state.about.units[names[0]] || "truck's unit";
    Object.assign(this, {names, least, unit: unit || given.replace("percent", "%"), figure: document.createElement("figure")});
    const caption = this.figure.appendChild(document.createElement("figcaption"));
    caption.append(Object.assign(document.createElement("b"), {textContent: title}));
    names.forEach((name, k) => {
      const value = Object.assign(document.createElement("output"), {id: `now-${name}`});
      const mark = Object.assign(document.createElement("i"), {className: k ? "leader" : "truck"});
      const label = document.createElement("span");
      label.append(mark, `${lines[name]} `, value);
      caption.append(label);
    });
    const commands = title.endsWith("command"), under = commands ? () => this._shade() : null;
    if (commands) caption.append(Object.assign(document.createElement("span"), {className: "silent", textContent: "shaded: it drives"}));
    $("strips").append(this.figure);
    const time = s => `${s} s`.replace("-", "−");
    this.chart = new Chart(this.figure, {height: 140, under, time, ink: tone("ink"), grid: tone("grid")});
  }

  draw() {
    const drawn = this.names.map((name, k) => {
      const {t, v} = samples(name), value = v[v.length - 1] ?? null, old = age(name);
      const text = value === null ? "–" : `${value.toFixed(1)} ${this.unit}`.replace("-", "−");
      write(`now-${name}`, old > OLD_S ? `– (${text}, ${old.toFixed(0)} s ago)` : text);
      return {xs: t.map(at => (at - state.now) / 1000), ys: v, colour: tone(k ? "leader" : "truck"), width: 1.8};
    });
    const [low, high] = reach(drawn.map(line => line.ys)), room = Math.max((this.least - (high - low)) / 2, 0);
    this.chart.draw(drawn, [-SHOWN_S, 0], [low - room, high + room], "", this.unit);
  }

  // Behind the commands: when they drive the truck.
  _shade() {
    const {t, v} = samples("engaged"), at = k => (t[k] - state.now) / 1000;
    let from = null;
    for (let k = 0; k <= v.length; k++) {
      if (from === null && v[k] === 1) from = at(k);
      if (from === null || v[k] === 1) continue;
      this.chart.span(from, k < v.length ? at(k) : 0, tone("truck"), 0.13);
      from = null;
    }
  }
}

function take(batches) {
  for (const {part, samples: came} of batches) {
    if (part !== state.part) continue;  // of where a replay was before it was moved
    for (const [name, [t, v]] of Object.entries(came)) {
      const all = samples(name);
      t.forEach((at, k) => {
        if (at - all.t[all.t.length - 1] > 1000 * OLD_S) { all.t.push(at); all.v.push(null); }
        all.t.push(at);
        all.v.push(v[k]);
      });
    }
  }
  for (const {t, v} of Object.values(series)) {
    const kept = t.findIndex((at, k) => at > state.now - 1000 * SHOWN_S || k === t.length - 1);
    if (kept > 0) { t.splice(0, kept); v.splice(0, kept); }
  }
}

function showWhoDrives() {
  const {state: core, not_engaged_because: why, no_load: idle} = state.safety, old = age("engaged");
  if (state.drives) {
    const text = state.drives[0].toUpperCase() + state.drives.slice(1) + (old > OLD_S ? ` (${old.toFixed(0)} s ago)` : "");
    const more = core ? ` Safety core: ${core}.${idle === "True" ? " Nothing is sent (no load)." : ""}` : " No safety core in this run.";
    write("drives", `${text}.${more}`, old > OLD_S ? "error" : state.drives === "the controller drives" ? "ok" : "warn");
  }
  list("reasons", why ? why.split("; ").map(reason => ["", reason]) : []);
}

function showNodes() {
  const still = state.ended !== null || state.replay.paused;
  list("nodes", Object.entries(state.nodes).sort().map(([name, [level, says, age]]) => {
    const silent = age > SILENT_S && !still, kind = silent ? "silent" : level;
    return [kind, `${GLYPHS[kind]} ${name}: ${says}${silent ? ` (${age.toFixed(0)} s ago)` : ""}`];
  }));
  list("events", state.events.slice().reverse().map(([at, level, node, says]) =>
    [level, `${(at / 1000).toFixed(1)} s ${GLYPHS[level]} ${node ? `${node}: ` : ""}${says}`]));
}

// Where a replay is; `position` is where its slider is held.
function showReplay(position = state.replay.position) {
  const {duration, paused, may_seek: may} = state.replay, over = state.ended !== null;
  $("replay").hidden = duration === undefined;
  if ($("replay").hidden) return;
  $("pause").disabled = over;
  $("seek").disabled = over || !may;
  $("seek").max = duration;
  write("pause", paused ? "▶ Continue" : "❚❚ Pause");
  write("recorded", `${position.toFixed(1)} of ${duration.toFixed(1)} s recorded${paused ? ", paused" : ""}${may ? "" : "; a copy is recorded, so it cannot be moved"}`);
  if (!moving) $("seek").value = position;
}

function show() {
  const {about: {title}, ended} = state;
  if (title && document.title !== title) document.title = document.querySelector("h1").textContent = title;
  for (const strip of strips) strip.draw();
  showWhoDrives();
  showNodes();
  if (!moving) showReplay();
  if (ended === null) {
    write("link", "● Connected.", "ok");
  } else {
    const bad = FAILED.test(ended);
    write("link", `${bad ? "✖" : "○"} The run has ended${ended ? `: ${ended}` : ""}. What you see is how it was then.`, bad ? "error" : "silent");
    document.body.className = "ended";
  }
}

const source = new EventSource("events");
source.onopen = () => { series = {}; };  // all that is kept follows
source.onmessage = ({data}) => {
  const {state: now, batches} = JSON.parse(data);
  if (state && now.part !== state.part) series = {};
  state = now;
  heardAt = performance.now();
  if (!strips.length) strips = STRIPS.map(each => new Strip(each));
  take(batches);
  if (state.ended !== null) source.close();
  requestAnimationFrame(show);
};
setInterval(() => {
  const silent = performance.now() - heardAt;
  if (silent > QUIET_MS && !(state && state.ended !== null)) {
    write("link", `✖ No word from the run for ${(silent / 1000).toFixed(0)} s. What you see is old.`, "error");
  }
}, 500);

function ask(what) { fetch("replay", {method: "POST", body: JSON.stringify(what)}); }
$("pause").onclick = () => ask({paused: state.replay.paused ? 0 : 1});
$("seek").oninput = () => { moving = true; showReplay(Number($("seek").value)); };
$("seek").onchange = () => { moving = false; ask({seek: Number($("seek").value)}); };
