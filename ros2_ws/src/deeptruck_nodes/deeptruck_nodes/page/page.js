// The page: receives the run's events, keeps the last minute, and shows it. It sends what is asked of a replay.
"use strict";

const $ = id => document.getElementById(id);
const LEVELS = {ok: ["✓", "good"], warn: ["▲", "waiting"], error: ["✖", "bad"]};
const SILENT_MS = 2000;  // without a batch, which come ten times a second
const SHIELD_MS = 3000;  // for so long the shield is said to have acted

let series = {}, health = {}, ages = {}, topics = {}, newest = -Infinity, missing = {};
let strips = [], source = null, heardAt = performance.now(), over = false, failed = "", due = false, lost = 0;
let replay = {}, moving = false;  // the newest state of a replay; whether its slider is held
const NOT_READY = ["it never began", "not everything got ready"];  // ends that nobody planned, in addition to a node that failed
const TOPIC_OF = {speed: "/truck/twist", leader_speed: "/radar/twist", gap: "/radar/range", engine_command: "/truck/command",
  brake_command: "/truck/command", residual: "/mismatch/residual", smoothed: "/mismatch/residual"};
const graph = new Graph($("graph"));

const data = name => series[name] || (series[name] = new Series());
const value = (node, key) => health[node] && health[node].values[key];

// How old the newest value of a series is, s, where that is more than usual; 0 where it is new.
function ageOf(name) {
  const [state, age] = topics[TOPIC_OF[name]] || ["fresh", 0];
  return state === "fresh" ? 0 : age;
}

function begin({nodes, links, units, health: said, run, missing: compared}) {
  const what = nodes.includes("replay") ? "A replay" : "A run, live";
  if (run) document.title = document.querySelector("h1").textContent = `${what}: ${run}`;
  [series, topics, ages, newest] = [{}, {}, {}, -Infinity];
  [health, missing] = [said, compared];
  graph.begin(links);
  makeStrips(units, nodes);
}

function makeStrips(units, nodes) {
  $("strips").replaceChildren();
  const add = options => strips.push(new Strip($("strips"), options));
  const spans = [{series: "engaged", says: "engaged", tone: "on"}, {series: "shield", says: "shield acted", tone: "shield", before: 1000}];
  const held = nodes.includes("can_bridge") || nodes.includes("replay") ? spans : spans.slice(1);
  strips = [];
  add({says: "Speed", unit: "m/s", least: 1, lines: [
    {series: "speed", says: "truck", tone: "truck"}, {series: "leader_speed", says: "leader by radar", tone: "leader", style: "dashed"}]});
  add({says: "Gap", unit: "m", least: 2, lines: [{series: "gap", says: "gap", tone: "truck"}]});
  for (const [name, says] of [["engine_command", "engine command"], ["brake_command", "brake command"]]) {
    if (!Object.keys(units).length || units[name]) {
      add({says, unit: (units[name] || "truck's unit").replace("percent", "%"), least: 2, spans: held, lines: [{series: name, says, tone: "truck"}]});
    }
  }
  if (!nodes.includes("mismatch_monitor") && !nodes.includes("replay")) return;
  add({says: "Residual", unit: "m/s²", least: 0.1, height: 160, lines: [
    {series: "residual", says: "measured less simulated", tone: "residual", style: "thin"},
    {series: "smoothed", says: "its mean of 5 s", tone: "smooth"}],
    spans: held.slice(0, held.length - 1),
    band: {says: "the simulator allows; dotted: a warning beyond", tone: "band", more: () => Number(value("mismatch_monitor", "threshold_m_s2")) || 0}});
}

function take(batch) {
  for (const [name, [t, v]] of Object.entries(batch.samples)) {
    const k = data(name).back(t);
    if (k >= 0) [series, newest] = [{}, -Infinity];  // all that is shown lies in the future of what follows
    data(name).add(t.slice(Math.max(k, 0)), v.slice(Math.max(k, 0)));
    newest = Math.max(newest, t[t.length - 1]);
  }
  for (const each of Object.values(series)) each.trim(newest - KEPT_MS);
  Object.assign(health, batch.health);
  if (batch.missing) missing = batch.missing;
  [topics, ages, replay] = [batch.topics, batch.ages, batch.replay];
}

function say(id, text, kind) {
  const where = $(id);
  if (where.textContent !== text) where.textContent = text;
  if (kind !== undefined && !where.classList.contains(kind)) where.className = `${where.tagName === "P" && id !== "link" ? "big " : ""}${kind}`;
}

function items(where, texts) {
  const key = texts.join("\n");
  if (where.dataset.key === key) return;
  where.dataset.key = key;
  where.replaceChildren(...texts.map(text => Object.assign(document.createElement("li"), {textContent: text})));
}

function showSafety() {
  const said = health.can_bridge;
  if (!said) {
    say("safety", "No CAN bridge: a simulated truck takes its commands without a safety core.", "quiet");
    return;
  }
  const {state, engaged, not_engaged_because: why, ...rest} = said.values, on = engaged === "True";
  const goes = rest.no_load === "True" ? "nothing is sent (no load)" : "commands go to the truck";
  say("safety", on ? `✓ Engaged: ${goes}. State: ${state}.` : `○ Not engaged. State: ${state}. ${said.level === "ok" ? "" : said.says}`,
    on ? "good" : said.level === "ok" ? "waiting" : "bad");
  $("why-not").hidden = !why;
  items($("reasons"), why ? why.split("; ") : []);
  const rows = Object.entries(rest).filter(([, text]) => text !== ""), key = JSON.stringify(rows);
  if ($("counts").dataset.key === key) return;
  $("counts").dataset.key = key;
  $("more").hidden = false;
  $("counts").replaceChildren(...rows.flatMap(([name, text]) => [
    Object.assign(document.createElement("dt"), {textContent: name.replaceAll("_", " ")}),
    Object.assign(document.createElement("dd"), {textContent: text})]));
}

function showShield() {
  const acted = value("controller", "shield_acted"), drove = value("controller", "baseline_drove");
  if (acted === undefined) return;
  const {t, v} = data("shield"), last = t.length - 1;
  if (last >= 0 && v[last] && newest - t[last] < SHIELD_MS) {
    say("shield", `▲ It acts: it braked in ${v[last]} steps of the last second, in ${acted} of the run.`, "bad");
  } else {
    say("shield", Number(acted) ? `✓ At rest. It braked in ${acted} steps of the run.` : "✓ At rest. It has not acted in this run.", "good");
  }
  say("baseline", Number(drove) ? `Outside of what the policy learned, the baseline drove ${drove} steps.` : "");
}

function shares(where, rows) {
  const key = JSON.stringify(rows);
  if (where.dataset.key === key) return;
  where.dataset.key = key;
  where.replaceChildren(...rows.map(([name, share, leaf]) => {
    const line = document.createElement("li"), bar = document.createElement("i"), value = document.createElement("b");
    line.className = leaf ? "leaf" : "";
    bar.style.width = `${100 * Math.min(Math.max(share, 0), 1)}%`;
    value.textContent = `${(100 * share).toFixed(0)} %`;
    line.append(bar, name, value);
    return line;
  }));
}

function showMissing() {
  const says = value("mismatch_monitor", "names"), [off, horizon] = missing.off || [], {names, budget} = missing;
  $("missing-part").hidden = !says && !names;
  if (says) say("missing", says[0].toUpperCase() + says.slice(1) + ".", "big");
  say("missing-say", off == null ? "" : `Free runs are off by ${off.toFixed(2)} m/s after ${horizon} s.`);
  document.querySelector(".shares").hidden = !(names && names.length);
  shares($("names"), (names || []).flatMap(([name, p, own]) => [[name, p], ...own.map(row => [...row, true])]));
  shares($("budget"), budget || []);
}

function showHealth() {
  const where = $("health"), names = Object.keys(health).sort();
  while (where.children.length > names.length) where.lastChild.remove();
  names.forEach((name, k) => {
    const line = where.children[k] || where.appendChild(document.createElement("li")), old = ages[name] > 3 && !over && !replay.paused;
    const [glyph, kind] = name === failed ? LEVELS.error : over ? ["○", "over"] : old ? ["○", "silent"] : LEVELS[health[name].level] || LEVELS.error;
    const then = name === failed ? `failed, and with it the run. It had said: ${health[name].says}` : health[name].says;
    const text = `${glyph} ${name}: ${then}${old ? ` (said ${ages[name].toFixed(0)} s ago)` : ""}`;
    if (line.textContent !== text) line.textContent = text;
    if (line.className !== kind) line.className = kind;
  });
}

// Where a replay is; `position` is where its slider is held.
function showReplay(position = replay.position) {
  if (replay.position === undefined) return;
  const {duration, paused, may_seek: may} = replay, stopped = over || !may;
  $("replay").hidden = false;
  $("pause").disabled = over;
  $("pause").textContent = paused ? "▶ Continue" : "❚❚ Pause";
  $("seek").disabled = stopped;
  $("seek").max = duration;
  if (!moving) $("seek").value = position;
  say("recorded", `${position.toFixed(1)} of ${duration.toFixed(1)} s recorded${paused ? ", paused" : ""}`);
  say("no-seek", may ? "" : "Seeking is off while you record.");
}

function ask(what) {
  fetch("replay", {method: "POST", body: JSON.stringify(what)}).catch(() => {});  // the link says that it is lost
}

function draw() {
  due = false;
  const seconds = Number($("window").value);
  const still = over || replay.paused;
  for (const strip of strips) strip.draw(data, Number.isFinite(newest) ? newest : 0, seconds, still ? () => 0 : ageOf);
  if (!moving) showReplay();
  graph.show(topics, over, failed);
  showSafety();
  showShield();
  showMissing();
  showHealth();
}

function drawSoon() {
  if (!due) requestAnimationFrame(draw);
  due = true;
}

function hear(kind, then) {
  source.addEventListener(kind, event => {
    heardAt = performance.now();
    then(event.data);
  });
}

function connect() {
  source = new EventSource("events");
  hear("hello", text => begin(JSON.parse(text)));
  hear("batch", text => {
    take(JSON.parse(text));
    say("link", `● Connected: shows ${replay.position === undefined ? "what happens now" : "the recorded time"}.`, "good");
    drawSoon();
  });
  hear("lost", text => {
    lost += Number(text);
    $("lost").hidden = false;
    say("lost", `This browser is slow: ${lost} batches were left out. The run does not wait for it.`, "waiting");
  });
  hear("ended", text => {
    over = true;
    source.close();
    failed = (text.match(/^(\S+) failed$/) || [])[1] || "";
    const bad = failed || NOT_READY.includes(text);
    say("link", `${bad ? "✖" : "○"} The run has ended${text ? `: ${text}${bad ? "" : ", as planned"}` : ""}. What you see is how it was then. A new run prints a new address.`,
      bad ? "bad" : "over");
    document.body.classList.add("ended");
    drawSoon();
  });
  source.onerror = () => {
    if (over) return;
    say("link", "✖ Connection lost. Trying again; what you see is old.", "bad");
    if (source.readyState !== EventSource.CLOSED) return;  // then the browser tries again by itself
    setTimeout(connect, 2000);
  };
}

setInterval(() => {
  const silent = performance.now() - heardAt;
  if (over || silent < SILENT_MS || source.readyState !== EventSource.OPEN) return;
  say("link", `✖ No word from the run for ${(silent / 1000).toFixed(0)} s. What you see is old.`, "bad");
}, 500);
addEventListener("resize", drawSoon);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawSoon);
$("window").addEventListener("change", drawSoon);
$("pause").addEventListener("click", () => ask({paused: replay.paused ? 0 : 1}));
$("seek").addEventListener("input", () => { moving = true; showReplay(Number($("seek").value)); });
$("seek").addEventListener("change", () => { moving = false; ask({seek: Number($("seek").value)}); });
connect();
