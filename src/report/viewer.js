// The viewer: one recording at a time, all its channels under one cursor and one zoom.
const RECORDINGS = DATA.recordings;
const RPM = 60 / (2 * Math.PI);
const LEFT = 56, RIGHT = 10, LABEL = 14;
const STATES = ["s0", "s1", "s2"];
const state = { recording: null, measured: [], channels: [], view: [0, 1], cursor: null, shown: { real: true, before: true, after: true, whatif: true }, rpm: false };
const stage = document.getElementById("stage");
let panels = [], speaking = 0;

const all = (selector) => [...document.querySelectorAll(selector)];
const whole = () => [0, Math.max(...state.channels.map((c) => c.times[c.times.length - 1] || 0), 1e-9)];
const zoomed = () => state.view[0] > whole()[0] || state.view[1] < whole()[1];

/// Speeds are shown in rpm on demand; everything else as recorded.
function inUnit(channel) {
  const factor = state.rpm && channel.unit === "rad/s" ? RPM : 1;
  if (factor === 1) return channel;
  const all = (lists) => Object.fromEntries(Object.entries(lists).map(([k, list]) => [k, list.map((v) => v * factor)]));
  return { ...channel, unit: "rpm", noise: channel.noise && channel.noise * factor, values: all(channel.values), gaps: all(channel.gaps),
    rms: Object.fromEntries(MODELS.map((k) => [k, channel.rms[k] * factor])) };
}

/// Shows recording `k`; a zoom that it can hold stays.
function choose(k, view = state.recording === null || !zoomed() ? null : state.view) {
  const recording = RECORDINGS[k];
  state.recording = k;
  state.measured = recording.channels.filter((c) => c.real.length).map((c) => decode(c, recording.dt));
  withWhatIf(false);
  arrange();
  state.view = view && view[0] < whole()[1] ? [Math.max(view[0], 0), Math.min(view[1], whole()[1])] : whole();
  state.cursor = null;
  for (const card of all(".card")) card.setAttribute("aria-pressed", String(Number(card.dataset.recording) === k));
  const card = document.querySelector(`.card[data-recording="${k}"]`);
  card.parentElement.scrollLeft = card.offsetLeft - 24;
  document.getElementById("states").hidden = !recording.phases.length;
  render();
  if (box?.open) replayed();
}

/// Flywheel and disc first, what drove them below.
function arrange() {
  const speeds = state.measured.filter((c) => c.column.startsWith("omega")), rest = state.measured.filter((c) => !c.column.startsWith("omega"));
  state.channels = [...speeds, ...beside(RECORDINGS[state.recording], state.measured, DATA.flywheel), ...rest];
}

/// The address names what is shown, so that a link shows the same.
function remember() {
  const name = encodeURIComponent(RECORDINGS[state.recording].name);
  const zoom = zoomed() ? "&zoom=" + state.view.map((t) => t.toFixed(4)).join("-") : "";
  history.replaceState(null, "", `#recording=${name}${zoom}`);
}

/// Recording and zoom that the address names, if any.
function recalled() {
  const found = /^#recording=([^&]*)(?:&zoom=([\d.]+)-([\d.]+))?$/.exec(location.hash);
  const k = found ? RECORDINGS.findIndex((r) => r.name === decodeURIComponent(found[1])) : -1;
  return k < 0 ? null : { k, view: found[2] && Number(found[2]) < Number(found[3]) ? [Number(found[2]), Number(found[3])] : null };
}

/// Draws everything but the cursor anew.
function render() {
  stage.replaceChildren();
  panels = state.channels.map((c) => panel(inUnit(c)));
  moveCursor(state.cursor);
}

function panel(channel) {
  const figure = add(stage, "figure");
  const caption = add(figure, "figcaption");
  add(caption, "b", "", channel.label + (channel.unit ? ", " + channel.unit : ""));
  const read = add(caption, "span", "read");
  const width = Math.max(240, stage.clientWidth), small = width < 560;
  const plotHeight = channel.alone ? (small ? 90 : 110) : small ? 140 : 180, stripHeight = small ? 46 : 54;
  const shown = channel.curves.filter((k) => state.shown[k]), models = channel.alone ? [] : MODELS.filter((k) => state.shown[k]);
  const bottom = plotHeight + models.length * (stripHeight + LABEL + 12) + 4, height = bottom + 20;
  const svg = draw(figure, "svg", { viewBox: `0 0 ${width} ${height}`, height, "aria-hidden": "true" });
  const from = Math.max(0, nearest(channel.times, state.view[0]) - 1), to = Math.min(channel.times.length - 1, nearest(channel.times, state.view[1]) + 1);
  const x = scale(...state.view, LEFT, width - RIGHT);
  const y = scale(...range(shown.map((k) => channel.values[k]), from, to), plotHeight, 6);
  // Each model has a strip and a scale of its own, since what is left is small beside what was there.
  const strips = models.map((k, n) => {
    const reach = Math.max(...range([channel.gaps[k]], from, to).map(Math.abs), 2.5 * (channel.noise || 0));
    const top = plotHeight + 12 + LABEL + n * (stripHeight + LABEL + 12);
    draw(svg, "rect", { class: "floor", x: LEFT, y: top - 2, width: width - LEFT - RIGHT, height: stripHeight + 4 });
    draw(svg, "text", { class: "side", x: LEFT, y: top - 6 }, `car minus model${MODELS.length > 1 ? ", " + NAMES[k] : ""}${channel.noise && !small ? "; band: ±2σ of noise" : ""}`);
    return { model: k, top, r: scale(-reach, reach, top + stripHeight, top) };
  });
  const plot = draw(svg, "svg", { x: LEFT, y: 0, width: width - LEFT - RIGHT, height, viewBox: `${LEFT} 0 ${width - LEFT - RIGHT} ${height}` });
  shade(plot, x, plotHeight);
  axes(svg, x, y, strips, width, bottom, small);
  svg.append(plot);
  for (const k of shown) draw(plot, "path", { class: "c-" + k, d: path(channel.times, channel.values[k], x, y, from, to) });
  for (const s of strips) {
    const strip = draw(plot, "g", { class: "strip" }), edge = (k) => s.r.at(k * channel.noise);
    if (channel.noise) draw(strip, "rect", { class: "noise", x: LEFT, width, y: edge(2), height: edge(-2) - edge(2) });
    draw(strip, "path", { class: "c-" + s.model, d: path(channel.times, channel.gaps[s.model], x, s.r, from, to) });
  }
  const cursor = draw(plot, "path", { class: "cursor" });
  const dots = Object.fromEntries(channel.curves.map((k) => [k, draw(plot, "circle", { class: "f-" + k, r: 3.5, display: "none" })]));
  const band = draw(plot, "rect", { class: "band", y: 0, height, display: "none" });
  const span = y.high - y.low;
  const made = { channel, svg, x, y, read, cursor, dots, band, from, to, span, height };
  offer(caption, svg, `${RECORDINGS[state.recording].name} ${channel.label}`, () => table(channel, from, to));
  svg.addEventListener("pointerdown", (event) => press(event, made));
  svg.addEventListener("pointermove", (event) => hover(event, made));
  svg.addEventListener("pointerup", (event) => release(event, made));
  svg.addEventListener("pointercancel", cancel);
  svg.addEventListener("pointerleave", () => { if (!drag) moveCursor(null); });
  svg.addEventListener("dblclick", reset);
  return made;
}

/// What is in view, as a table.
function table(channel, from, to) {
  const rows = [["time_s", ...channel.curves.map((k) => `${NAMES[k]} [${channel.unit || "1"}]`)].join(",")];
  const cell = (v) => (Number.isFinite(v) ? String(Number(v.toPrecision(12))) : "");
  for (let i = from; i <= to; i++) rows.push([channel.times[i], ...channel.curves.map((k) => channel.values[k][i])].map(cell).join(","));
  return rows.join("\n") + "\n";
}

/// Open, slipping and locked behind the curves.
function shade(plot, x, height) {
  const recording = RECORDINGS[state.recording], end = whole()[1];
  recording.phases.forEach(([sample, phase], k) => {
    const until = k + 1 < recording.phases.length ? recording.phases[k + 1][0] * recording.dt : end;
    const [a, b] = [x.at(Math.max(sample * recording.dt, state.view[0])), x.at(Math.min(until, state.view[1]))];
    if (b > a) draw(plot, "rect", { class: STATES[phase], x: a, width: b - a, y: 0, height });
  });
}

function axes(svg, x, y, strips, width, bottom, small) {
  for (const axis of [y, ...strips.map((s) => s.r)]) for (const t of axis === y ? ticks(y.low, y.high, 4) : bounds(axis.high)) {
    const p = axis.at(t.value);
    draw(svg, "path", { class: axis !== y && t.value === 0 ? "grid zero" : "grid", d: `M${LEFT} ${p}H${width - RIGHT}` });
    draw(svg, "text", { class: "tick", x: LEFT - 6, y: p + 4, "text-anchor": "end" }, t.text);
  }
  for (const t of ticks(x.low, x.high, small ? 5 : 9)) {
    draw(svg, "path", { class: "grid", d: [[0, y.a], ...strips.map((s) => [s.top - 2, s.r.a + 2])].map(([a, b]) => `M${x.at(t.value)} ${a}V${b}`).join("") });
    if (x.at(t.value) < width - 22) draw(svg, "text", { class: "tick x", x: x.at(t.value), y: bottom + 14, "text-anchor": "middle" }, t.text + " s");
  }
}

/// Puts the cursor of all channels at a time, or takes it away; without it the captions tell the rms gap in view.
function moveCursor(time) {
  state.cursor = time;
  const recording = RECORDINGS[state.recording];
  const place = time === null ? (zoomed() ? `${state.view.map((t) => t.toFixed(2)).join(" to ")} s` : "") : `t = ${time.toFixed(recording.dt < 0.005 ? 3 : 2)} s`;
  document.getElementById("shown").textContent = [recording.name, recording.manoeuvre.replaceAll("_", " "), recording.held_out ? "held out" : "", place].filter(Boolean).join(" · ");
  for (const p of panels) mark(p, time);
}

function mark(p, time) {
  const { channel, span } = p;
  p.read.replaceChildren();
  p.cursor.setAttribute("d", "");
  for (const k of channel.curves) p.dots[k].setAttribute("display", "none");
  if (time === null && channel.alone) return;
  if (time === null) {
    // Peaks are overrepresented among drawn points, so that the whole view has the figure of all samples.
    const gap = (k) => zoomed() ? rms(channel.gaps[k], p.from, p.to) : channel.rms[k], about = channel.thinned && zoomed() ? "about " : "";
    add(p.read, "span", "", "car minus model (rms) in view:");
    for (const k of MODELS) if (state.shown[k]) add(p.read, "span", "t-" + k, `${NAMES[k]} ${about}${rounded(gap(k))} ${channel.unit}`);
    if (channel.thinned) add(p.read, "span", "", `(${channel.times.length} of ${channel.samples} samples drawn, peaks kept)`);
    return;
  }
  const i = nearest(channel.times, time), place = p.x.at(channel.times[i]);
  // The cursor stands at one instant everywhere; where samples are left out, the nearest that is drawn is read.
  p.cursor.setAttribute("d", `M${p.x.at(time)} 0V${p.height}`);
  for (const k of channel.curves) {
    if (!state.shown[k]) continue;
    const value = channel.values[k][i];
    const gap = k === "real" || channel.alone ? "" : ` (car minus model ${signed(channel.gaps[k][i], span)})`;
    add(p.read, "span", "t-" + k, `${NAMES[k]} ${reading(value, span)}${gap}`);
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
  remember();
}

function zoomBy(factor) {
  const centre = state.cursor ?? (state.view[0] + state.view[1]) / 2;
  zoomTo(centre - (centre - state.view[0]) * factor, centre + (state.view[1] - centre) * factor);
}

function reset() {
  state.view = whole();
  render();
  remember();
}
