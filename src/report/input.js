// Pointer, keys and buttons.
let drag = null;

function timeAt(event, p) {
  const box = p.svg.getBoundingClientRect();
  const time = p.x.back((event.clientX - box.left) * p.svg.viewBox.baseVal.width / box.width);
  return Math.min(Math.max(time, state.view[0]), state.view[1]);
}

function snap(p, time) {
  return p.channel.times[nearest(p.channel.times, time)];
}

function press(event, p) {
  // A finger scrolls and reads; it zooms by the buttons.
  if (event.button !== 0 || event.pointerType === "touch") return hover(event, p);
  drag = { from: timeAt(event, p), to: null, x: event.clientX };
  p.svg.setPointerCapture(event.pointerId);
}

function hover(event, p) {
  const time = timeAt(event, p);
  if (drag && Math.abs(event.clientX - drag.x) > 4) drag.to = time;
  if (drag?.to != null) {
    for (const q of panels) {
      const [a, b] = [q.x.at(drag.from), q.x.at(drag.to)].sort((m, n) => m - n);
      for (const [key, v] of [["x", a], ["width", b - a], ["display", "inline"]]) q.band.setAttribute(key, v);
    }
  }
  moveCursor(snap(p, time));
}

function release() {
  const ended = drag;
  cancel();
  if (ended?.to != null) zoomTo(Math.min(ended.from, ended.to), Math.max(ended.from, ended.to));
}

function cancel() {
  drag = null;
  for (const p of panels) p.band.setAttribute("display", "none");
}

/// Moves the cursor by samples; the view follows it.
function step(count) {
  const times = state.channels[0]?.times;
  if (!times) return;
  const start = state.cursor === null ? nearest(times, (state.view[0] + state.view[1]) / 2) : nearest(times, state.cursor) + count;
  goTo(times[Math.min(Math.max(start, 0), times.length - 1)]);
}

function goTo(time) {
  const [low, high] = state.view;
  state.cursor = time;
  if (time < low) return zoomTo(time, time + high - low);
  if (time > high) return zoomTo(time - (high - low), time);
  moveCursor(time);
}

const KEYS = {
  ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
  ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
  Home: () => goTo(whole()[0]),
  End: () => goTo(whole()[1]),
  "+": () => zoomBy(0.5), "=": () => zoomBy(0.5), "-": () => zoomBy(2), "−": () => zoomBy(2),
  Escape: () => { cancel(); state.cursor = null; reset(); },
  PageUp: () => turnTo((state.recording + RECORDINGS.length - 1) % RECORDINGS.length),
  PageDown: () => turnTo((state.recording + 1) % RECORDINGS.length),
};

/// Another recording, by the reader's wish.
function turnTo(k) {
  choose(k);
  remember();
}

/// Recording and zoom as the address has them; else the one that proves most.
function follow() {
  const wanted = recalled();
  if (wanted) choose(wanted.k, wanted.view);
  return Boolean(wanted);
}

/// One of two residual maps.
function switchMaps() {
  const buttons = all("[data-map]");
  const show = (name) => {
    for (const b of buttons) b.setAttribute("aria-pressed", String(b.dataset.map === name));
    for (const m of all(".map")) m.classList.toggle("away", !m.classList.contains(name));
  };
  for (const b of buttons) b.addEventListener("click", () => show(b.dataset.map));
  if (buttons.length) show("map-before");
}

function start() {
  for (const card of all(".card")) card.addEventListener("click", () => { turnTo(Number(card.dataset.recording)); speak(); });
  for (const button of all("[data-curve]")) button.addEventListener("click", () => {
    state.shown[button.dataset.curve] = !state.shown[button.dataset.curve];
    button.setAttribute("aria-pressed", String(state.shown[button.dataset.curve]));
    render();
  });
  for (const button of all("[data-zoom]")) button.addEventListener("click", () => {
    ({ in: () => zoomBy(0.5), out: () => zoomBy(2), reset })[button.dataset.zoom]();
    speak();
  });
  document.getElementById("rpm").addEventListener("click", (event) => {
    state.rpm = !state.rpm;
    event.currentTarget.setAttribute("aria-pressed", String(state.rpm));
    render();
  });
  stage.addEventListener("keydown", (event) => {
    const act = event.ctrlKey || event.metaKey || event.altKey ? undefined : KEYS[event.key];
    if (!act) return;
    event.preventDefault();
    act(event);
    speak();
  });
  startWhatIf();
  let width = 0;
  new ResizeObserver(() => { if (stage.clientWidth !== width) { width = stage.clientWidth; if (width) render(); } }).observe(stage);
  window.addEventListener("hashchange", follow);
  if (!follow()) choose(Number(document.querySelector(".card[aria-pressed=true]").dataset.recording));
}

document.documentElement.classList.add("js");
switchMaps();
offerStills();
if (stage && RECORDINGS.length) start();
