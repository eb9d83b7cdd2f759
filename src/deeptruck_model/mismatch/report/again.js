
// Leave rows out and compare again: the server that shows this page does it, and says how far it is.
const made = (kind, text = "", more = {}) => Object.assign(document.createElement(kind), {textContent: text, ...more});

function list() {
  part("marks").replaceChildren(...marks.map((m, k) => {
    const line = made("li", `${m.drive}, ${m.from.toFixed(1)} to ${m.to.toFixed(1)} s`);
    line.append(made("button", "remove", {onclick: () => { marks.splice(k, 1); list(); draw(); }}));
    return line;
  }));
  part("compare").disabled = !marks.length;
}

part("mark").onclick = () => {
  if (!view) {
    part("step").textContent = "Drag over rows first: the whole drive is shown.";
    return;
  }
  part("step").textContent = "";
  const d = data.drives[drives.value];
  marks.push({drive: d.name, from: view[0], to: view[1]});
  view = null;
  list();
  draw();
};

function table(heads, rows) {
  const out = made("table"), head = made("tr"), body = made("tbody");
  head.append(...heads.map((text, k) => made("th", text, {className: k ? "n" : ""})));
  body.append(...rows.map(row => {
    const line = made("tr");
    line.append(...row.map((text, k) => made(k ? "td" : "th", text, {className: k ? "n" : ""})));
    return line;
  }));
  const top = made("thead"), wide = made("div", "", {className: "wide"});
  top.append(head);
  out.append(top, body);
  wide.append(out);
  return wide;
}

function show({number, headline, lines, budget, errors, units, left_out: rows, command}) {
  const again = part("again"), heads = ["all rows", "without the marked"];
  again.hidden = false;
  again.replaceChildren(
    made("h3", `Without the marked rows: ${headline}`), made("p", `${rows} samples were left out.`, {className: "quiet"}),
    ...lines.filter(text => text).map(text => made("p", text)));
  if (budget.length) again.append(table(["squared speed error", ...heads], budget));
  if (errors.length) again.append(table([`speed error, ${units}`, ...heads], errors));
  if (command) again.append(made("pre", command));
  const link = made("p");
  link.append(made("a", "The whole page of this comparison", {href: `again/${number}/`, target: "_blank", rel: "noopener"}));
  again.append(link);
}

async function follow() {
  const {state, step, result} = await (await fetch("state")).json();
  part("step").textContent = state === "running" ? `${step} ...` : state === "refused" ? step : "";
  if (state === "running") return void setTimeout(() => follow().catch(lost), 300);
  part("mark").disabled = false;
  part("compare").disabled = !marks.length;
  if (state === "done") show(result);
}

function lost() {
  part("step").textContent = "The program that serves this page has ended; start it again.";
}

part("compare").onclick = async () => {
  part("mark").disabled = part("compare").disabled = true;
  part("step").textContent = "comparing ...";
  try {
    await fetch("again", {method: "POST", body: JSON.stringify(marks)});
    await follow();
  } catch {
    lost();
  }
};
list();
