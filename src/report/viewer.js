// The viewer: one recording at a time, all its channels under one cursor and one zoom.
const RECORDINGS = JSON.parse(document.getElementById("series").textContent).recordings;
const RPM = 60 / (2 * Math.PI);
const LEFT = 56, RIGHT = 10;
const state = { recording: 0, channels: [], view: [0, 1], cursor: null, shown: { real: true, before: true, after: true }, rpm: false };
const stage = document.getElementById("stage");
let panels = [], speaking = 0;

const all = (selector) => [...document.querySelectorAll(selector)];
const whole = () => [0, Math.max(...state.channels.map((c) => c.times[c.times.length - 1] || 0), 1e-9)];
const zoomed = () => state.view[0] > whole()[0] || state.view[1] < whole()[1];

/// Speeds are shown in rpm on demand; everything else as recorded.
function inUnit(channel) {
  const factor = state.rpm && channel.unit === "rad/s" ? RPM : 1;
  const times = (list) => list.map((v) => v * factor);
  return { ...channel, unit: factor === 1 ? channel.unit : "rpm", noise: channel.noise && channel.noise * factor,
    values: Object.fromEntries(CURVES.map((k) => [k, times(channel.values[k])])), gaps: Object.fromEntries(MODELS.map((k) => [k, times(channel.gaps[k])])),
    rms: Object.fromEntries(MODELS.map((k) => [k, channel.rms[k] * factor])) };
}

function choose(k) {
  const recording = RECORDINGS[k];
  state.recording = k;
  state.channels = recording.channels.filter((c) => c.real.length).map((c) => decode(c, recording.dt));
  state.view = whole();
  state.cursor = null;
  for (const card of all(".card")) card.setAttribute("aria-pressed", String(Number(card.dataset.recording) === k));
  const card = document.querySelector(`.card[data-recording="${k}"]`);
  card.parentElement.scrollLeft = card.offsetLeft - 24;
  render();
}

/// Draws everything but the cursor anew.
function render() {
  stage.replaceChildren();
  panels = state.channels.map((c, k) => panel(inUnit(c), k === state.channels.length - 1));
  moveCursor(state.cursor);
}

function panel(channel, last) {
  const figure = add(stage, "figure");
  const caption = add(figure, "figcaption");
  add(caption, "b", "", channel.label + (channel.unit ? ", " + channel.unit : ""));
  const read = add(caption, "span", "read");
  const width = Math.max(240, stage.clientWidth), small = width < 560;
  const plotHeight = small ? 140 : 180, stripHeight = small ? 46 : 54;
  const models = MODELS.filter((k) => state.shown[k]);
  const bottom = plotHeight + models.length * (stripHeight + 12), height = bottom + (last ? 22 : 4);
  const svg = draw(figure, "svg", { viewBox: `0 0 ${width} ${height}`, height, "aria-hidden": "true" });
  const from = Math.max(0, nearest(channel.times, state.view[0]) - 1), to = Math.min(channel.times.length - 1, nearest(channel.times, state.view[1]) + 1);
  const x = scale(...state.view, LEFT, width - RIGHT);
  const y = scale(...range(CURVES.filter((k) => state.shown[k]).map((k) => channel.values[k]), from, to), plotHeight, 6);
  // Each model has a strip and a scale of its own, since what is left is small beside what was there.
  const strips = models.map((k, n) => {
    const reach = Math.max(...range([channel.gaps[k]], from, to).map(Math.abs), 2.5 * (channel.noise || 0));
    const top = plotHeight + 12 + n * (stripHeight + 12);
    draw(svg, "rect", { class: "floor", x: LEFT, y: top - 2, width: width - LEFT - RIGHT, height: stripHeight + 4 });
    return { model: k, top, r: scale(-reach, reach, top + stripHeight, top) };
  });
  axes(svg, x, y, strips.map((s) => s.r), width, bottom, last, small);
  const plot = draw(svg, "svg", { x: LEFT, y: 0, width: width - LEFT - RIGHT, height, viewBox: `${LEFT} 0 ${width - LEFT - RIGHT} ${height}` });
  for (const k of CURVES) if (state.shown[k]) draw(plot, "path", { class: "c-" + k, d: path(channel.times, channel.values[k], x, y, from, to) });
  for (const s of strips) {
    const strip = draw(plot, "g", { class: "strip" }), edge = (k) => s.r.at(k * channel.noise);
    if (channel.noise) draw(strip, "rect", { class: "noise", x: LEFT, width, y: edge(2), height: edge(-2) - edge(2) });
    draw(strip, "path", { class: "c-" + s.model, d: path(channel.times, channel.gaps[s.model], x, s.r, from, to) });
    draw(svg, "text", { class: "side", x: LEFT + 5, y: s.top + 10 }, `real − ${s.model}${channel.noise && !small ? ", band: ±2σ of noise" : ""}`);
  }
  const cursor = draw(plot, "path", { class: "cursor" });
  const dots = Object.fromEntries(CURVES.map((k) => [k, draw(plot, "circle", { class: "f-" + k, r: 3.5, display: "none" })]));
  const band = draw(plot, "rect", { class: "band", y: 0, height, display: "none" });
  const span = y.high - y.low;
  const made = { channel, svg, x, y, read, cursor, dots, band, from, to, span, height };
  svg.addEventListener("pointerdown", (event) => press(event, made));
  svg.addEventListener("pointermove", (event) => hover(event, made));
  svg.addEventListener("pointerup", (event) => release(event, made));
  svg.addEventListener("pointercancel", cancel);
  svg.addEventListener("pointerleave", () => { if (!drag) moveCursor(null); });
  svg.addEventListener("dblclick", reset);
  return made;
}

function axes(svg, x, y, strips, width, bottom, last, small) {
  for (const axis of [y, ...strips]) for (const t of axis === y ? ticks(y.low, y.high, 4) : bounds(axis.high)) {
    const p = axis.at(t.value);
    draw(svg, "path", { class: axis !== y && t.value === 0 ? "grid zero" : "grid", d: `M${LEFT} ${p}H${width - RIGHT}` });
    draw(svg, "text", { class: "tick", x: LEFT - 6, y: p + 4, "text-anchor": "end" }, t.text);
  }
  for (const t of ticks(x.low, x.high, small ? 5 : 9)) {
    draw(svg, "path", { class: "grid", d: `M${x.at(t.value)} 0V${bottom}` });
    if (last && x.at(t.value) < width - 22) draw(svg, "text", { class: "tick x", x: x.at(t.value), y: bottom + 16, "text-anchor": "middle" }, t.text + " s");
  }
}

/// Puts the cursor of all channels at a time, or takes it away; without it the captions tell the rms gap in view.
function moveCursor(time) {
  state.cursor = time;
  const recording = RECORDINGS[state.recording];
  const place = time === null ? (zoomed() ? `${state.view.map((t) => t.toFixed(2)).join(" to ")} s` : "") : `t = ${time.toFixed(recording.dt < 0.005 ? 3 : 2)} s`;
  document.getElementById("shown").textContent = [recording.name, recording.manoeuvre.replaceAll("_", " "), place].filter(Boolean).join(" · ");
  for (const p of panels) mark(p, time);
}

function mark(p, time) {
  const { channel, span } = p;
  p.read.replaceChildren();
  p.cursor.setAttribute("d", "");
  for (const k of CURVES) p.dots[k].setAttribute("display", "none");
  if (time === null) {
    // Peaks are overrepresented among drawn points, so that the whole view has the figure of all samples.
    const gap = (k) => zoomed() ? rms(channel.gaps[k], p.from, p.to) : channel.rms[k], about = channel.thinned && zoomed() ? "about " : "";
    add(p.read, "span", "", "rms gap in view:");
    for (const k of MODELS) if (state.shown[k]) add(p.read, "span", "t-" + k, `${k} ${about}${rounded(gap(k))} ${channel.unit}`);
    if (channel.thinned) add(p.read, "span", "", `(${channel.times.length} of ${channel.samples} samples drawn, peaks kept)`);
    return;
  }
  const i = nearest(channel.times, time), place = p.x.at(channel.times[i]);
  // The cursor stands at one instant everywhere; where samples are left out, the nearest that is drawn is read.
  p.cursor.setAttribute("d", `M${p.x.at(time)} 0V${p.height}`);
  for (const k of CURVES) {
    if (!state.shown[k]) continue;
    const value = channel.values[k][i];
    const gap = k === "real" ? "" : ` (gap ${signed(channel.gaps[k][i], span)})`;
    add(p.read, "span", "t-" + k, `${k} ${reading(value, span)}${gap}`);
    if (Number.isFinite(value)) for (const [key, v] of [["cx", place], ["cy", p.y.at(value)], ["display", "inline"]]) p.dots[k].setAttribute(key, v);
  }
}

/// Reads the values out, once the cursor rests.
function speak() {
  clearTimeout(speaking);
  speaking = setTimeout(() => {
    const at = state.cursor === null ? `Shown: ${state.view.map((t) => t.toFixed(2)).join(" to ")} seconds. ` : `${state.cursor.toFixed(2)} seconds. `;
    document.getElementById("spoken").textContent = at + panels.map((p) => `${p.channel.label}: ${[...p.read.children].map((s) => s.textContent).join(", ")}`).join(". ");
  }, 250);
}

function zoomTo(low, high) {
  const [start, end] = whole(), least = Math.max(8 * RECORDINGS[state.recording].dt, 1e-6);
  const length = Math.min(Math.max(high - low, least), end - start);
  const from = Math.min(Math.max(low, start), end - length);
  state.view = [from, from + length];
  if (state.cursor !== null) state.cursor = Math.min(Math.max(state.cursor, state.view[0]), state.view[1]);
  render();
}

function zoomBy(factor) {
  const centre = state.cursor ?? (state.view[0] + state.view[1]) / 2;
  zoomTo(centre - (centre - state.view[0]) * factor, centre + (state.view[1] - centre) * factor);
}

function reset() {
  state.view = whole();
  render();
}
