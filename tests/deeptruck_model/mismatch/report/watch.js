// What the browser test does to the pages in its frames, and what it then sees; the title tells it.
addEventListener("load", () => {
  const inside = id => document.getElementById(id).contentWindow;
  const onWhite = (x, i, k) => 255 + (x[i + k] - 255) * x[i + 3] / 255;
  const like = (...rgb) => (x, i) => rgb.every((v, k) => Math.abs(onWhite(x, i, k) - v) < 6);
  const DOT = like(194, 24, 91), SHADE = like(242, 204, 219), CHOSEN = like(86, 180, 233);
  const count = (canvas, which) => {
    const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let n = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] && which(data, i)) n++;
    return n;
  };
  const drag = (page, canvas, from, to) => {
    const box = canvas.getBoundingClientRect();
    [["pointerdown", from], ["pointermove", to], ["pointerup", to]].forEach(([name, at]) => canvas.dispatchEvent(
      new page.PointerEvent(name, {clientX: box.left + at[0] * box.width, clientY: box.top + at[1] * box.height, button: 0})));
  };
  const press = (page, canvas, key) => canvas.dispatchEvent(new page.KeyboardEvent("keydown", {key, bubbles: true}));
  const layout = id => {
    const page = inside(id), document = page.document;
    return {wide: document.documentElement.scrollWidth, frame: page.innerWidth,
      loaded: [...document.images].every(image => image.naturalWidth > 99), explorer: !document.getElementById("explorer").hidden,
      open: [...document.querySelectorAll("details.print")].map(x => x.open)};
  };
  const watch = () => {
    const page = inside("explored"), $ = id => page.document.getElementById(id);
    const time = page.document.querySelector("#timelines canvas");
    const marks = () => ({time: count(time, SHADE), track: count($("track"), DOT), regime: count($("regime"), DOT),
      explained: count($("explained"), DOT), curve: $("curve").hidden ? 0 : count($("curve"), CHOSEN), said: $("marked").textContent});
    const seen = {before: marks()};
    const then = (name, act) => { act(); seen[name] = marks(); };
    then("brushed", () => drag(page, time, [0.6, 0.6], [0.8, 0.7]));
    then("zoomed", () => $("zoom").click());
    then("escaped", () => { $("whole").click(); press(page, time, "Escape"); });
    then("keyed", () => press(page, time, "ArrowRight"));
    then("brushedElsewhere", () => drag(page, $("explained"), [0.3, 0.1], [0.7, 0.8]));
    then("clicked", () => $("finding-list").children[1].click());
    seen.pressed = $("finding-list").children[1].getAttribute("aria-pressed");
    const box = $("timelines"), last = box.lastElementChild.getBoundingClientRect().top;
    seen.below = last > box.getBoundingClientRect().bottom - 40;
    then("last", () => [...$("segments").children].at(-1).click());
    seen.shown = box.lastElementChild.getBoundingClientRect().top < box.getBoundingClientRect().bottom - 40;
    seen.errors = $("held-out-errors").rows.length;
    return seen;
  };
  try {
    const told = {explored: watch()};
    for (const frame of document.querySelectorAll("iframe")) told[frame.id] = {...told[frame.id], ...layout(frame.id)};
    document.title = JSON.stringify(told);
  } catch (error) { document.title = JSON.stringify({error: String(error.stack)}); }
});
