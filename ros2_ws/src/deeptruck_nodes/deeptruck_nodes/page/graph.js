// The node graph in three columns: who publishes, the topics, who listens. Glyph, dashes and colour say the same.
"use strict";

const GLYPH = {fresh: "●", late: "◐", silent: "○", unheard: "○"};
const ROW = 38;

function shape(kind, attributes, text = "") {
  const made = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = text;
  return made;
}

class Graph {
  constructor(where) {
    this.where = where;
    this.links = [];
    this.drawn = "";
  }

  begin(links) {
    this.links = links;
    this.drawn = "";
  }

  // What is expected or was heard is drawn; anew only where that, or the width, has changed.
  show(topics, over = false, failed = "") {
    const shown = this.links.filter(link => link.expected || topics[link.topic]);
    const width = Math.max(this.where.clientWidth, 300), key = `${width} ${shown.map(link => link.topic)}`;
    if (key !== this.drawn) this._draw(shown, width);
    this.drawn = key;
    for (const {topic} of shown) this._state(topic, topics[topic], over);
    if (failed) this._fail(failed);
    const states = shown.map(({topic}) => `${topic} ${over ? "ended" : topics[topic] ? topics[topic][0] : "silent"}`);
    this.svg.setAttribute("aria-label", `${failed ? `${failed} failed. ` : ""}Topics: ${states.join(", ")}`);
  }

  _draw(links, width) {
    const froms = [...new Set(links.flatMap(link => link.from))], tos = [...new Set(links.flatMap(link => link.to))];
    const height = Math.max(links.length, froms.length, tos.length) * ROW + 8, side = Math.min(120, width * 0.29);
    const middle = Math.min(150, width * 0.345), x0 = (width - middle) / 2;
    this.svg = shape("svg", {viewBox: `0 0 ${width} ${height}`, height, role: "img", class: width < 420 ? "narrow" : ""});
    const place = (names) => Object.fromEntries(names.map((name, k) => [name, (k + 0.5) * height / names.length]));
    const left = place(froms), right = place(tos), mid = place(links.map(link => link.topic));
    this.parts = {};
    for (const {topic, from, to} of links) {
      const part = shape("g", {}), y = mid[topic];
      for (const name of from) part.append(this._edge(side, left[name], x0, y));
      for (const name of to) part.append(this._edge(x0 + middle, y, width - side, right[name]));
      part.append(shape("rect", {class: "topic", x: x0, y: y - 15, width: middle, height: 30, rx: 15}));
      part.append(this._text(width / 2, y - 3, topic), this._text(width / 2, y + 10, ""));
      part.dataset.topic = topic;
      this.parts[topic] = part;
      this.svg.append(part);
    }
    for (const [names, x] of [[left, 0], [right, width - side]]) for (const [name, y] of Object.entries(names)) {
      const node = shape("g", {class: "box"});
      node.dataset.node = name;
      node.append(shape("rect", {class: "node", x: x + 0.5, y: y - 13, width: side - 1, height: 26, rx: 4}), this._text(x + side / 2, y + 4, name));
      this.svg.append(node);
    }
    this.where.replaceChildren(this.svg);
  }

  _edge(x0, y0, x1, y1) {
    const half = (x0 + x1) / 2;
    return shape("path", {d: `M${x0} ${y0}C${half} ${y0} ${half} ${y1} ${x1} ${y1}`});
  }

  _text(x, y, text) { return shape("text", {x, y, "text-anchor": "middle"}, text); }

  // A node that failed, in red and with a cross, wherever it stands.
  _fail(name) {
    for (const node of this.svg.querySelectorAll(`[data-node="${name}"]`)) {
      node.setAttribute("class", "box failed");
      node.lastChild.textContent = `✖ ${name}`;
    }
  }

  _state(topic, heard, over) {
    const [state, age, rate] = heard || ["unheard", 0, 0], part = this.parts[topic];
    part.setAttribute("class", over ? "over" : state);
    const often = rate > 0 && rate <= 0.1 ? `every ${(1 / rate).toFixed(0)} s` : `${rate.toFixed(rate >= 10 ? 0 : 1)} Hz`;
    const says = state === "unheard" ? "nothing received yet" : state === "fresh" ? `${often}, ${age.toFixed(1)} s`
      : `${state} for ${age.toFixed(1)} s`;
    part.lastChild.textContent = over ? `until the end, ${often}` : `${GLYPH[state]} ${says}`;
    if (over && !heard) part.lastChild.textContent = "nothing received";
  }
}
