// Decoding, scales and drawing: functions that know nothing of the page's state.
const CURVES = ["real", "before", "after"];
const MODELS = ["before", "after"];

/// Curves of a channel from its integers: times in s, values in the channel's unit, NaN where the car has a gap.
function decode(channel, dt) {
  let at = 0, level = 0;
  const times = channel.real.map((_, i) => (at = channel.index ? at + channel.index[i] : i) * dt);
  const real = channel.real.map((step) => (step === null ? NaN : (level += step) * channel.q));
  const gap = (name) => channel[name].map((k) => (k === null ? NaN : k * channel.q));
  const gaps = { before: gap("before"), after: gap("after") };
  const model = (name) => real.map((r, i) => r - gaps[name][i]);
  return { label: channel.label, unit: channel.unit, noise: channel.noise, samples: channel.samples, thinned: Boolean(channel.index),
    rms: { before: channel.rms[0] ?? NaN, after: channel.rms[1] ?? NaN },
    times, gaps, values: { real, before: model("before"), after: model("after") } };
}

/// Index of the sample nearest to `time`.
function nearest(times, time) {
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  return high >= 0 && Math.abs(times[high] - time) < Math.abs(times[low] - time) ? high : low;
}

function scale(low, high, a, b) {
  return { low, high, at: (v) => a + (v - low) / (high - low) * (b - a), back: (p) => low + (p - a) / (b - a) * (high - low) };
}

/// Least and greatest finite value of several lists between two indices, widened a little.
function range(lists, from, to) {
  let low = Infinity, high = -Infinity;
  for (const list of lists) for (let i = from; i <= to; i++) {
    if (list[i] < low) low = list[i];
    if (list[i] > high) high = list[i];
  }
  if (low > high) return [0, 1];
  const margin = high > low ? 0.05 * (high - low) : 0.5 * Math.max(Math.abs(high), 1e-3);
  return [low - margin, high + margin];
}

/// Round values within a range, with the decimals that tell them apart.
function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((m) => m * power >= raw * 0.999999);
  const places = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  const out = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) out.push({ value: k * step, text: minus((k * step).toFixed(places)) });
  return out;
}

/// Zero and a round value on either side, for a strip that reaches so far.
function bounds(reach) {
  const power = 10 ** Math.floor(Math.log10(reach));
  const value = power * [5, 2, 1].find((m) => m * power <= reach * 1.000001);
  const places = Math.max(0, Math.ceil(-Math.log10(value) - 1e-9));
  return [-value, 0, value].map((v) => ({ value: v, text: v ? minus(v.toFixed(places)) : "0" }));
}

function minus(text) {
  return text.replace(/^-(?=.*[1-9])/, "−").replace(/^-/, "");
}

/// A number with as many decimals as its channel's range deserves.
function reading(value, span) {
  if (!Number.isFinite(value)) return "–";
  return minus(value.toFixed(Math.min(6, Math.max(0, 3 - Math.floor(Math.log10(span || 1))))));
}

/// Three significant digits.
function rounded(value) {
  return Number.isFinite(value) ? minus(value.toFixed(Math.min(6, Math.max(0, value ? 2 - Math.floor(Math.log10(Math.abs(value))) : 0)))) : "–";
}

function signed(value, span) {
  const text = reading(value, span);
  return value > 0 && /[1-9]/.test(text) ? "+" + text : text;
}

function rms(list, from, to) {
  let sum = 0, count = 0;
  for (let i = from; i <= to; i++) if (Number.isFinite(list[i])) { sum += list[i] * list[i]; count++; }
  return Math.sqrt(sum / count);
}

function path(times, values, x, y, from, to) {
  let out = "", pen = "M";
  for (let i = from; i <= to; i++) {
    if (!Number.isFinite(values[i])) { pen = "M"; continue; }
    out += pen + x.at(times[i]).toFixed(1) + " " + y.at(values[i]).toFixed(1);
    pen = "L";
  }
  return out;
}

/// An SVG element with attributes, appended to its parent.
function draw(parent, name, attributes, content) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const key in attributes) element.setAttribute(key, attributes[key]);
  if (content !== undefined) element.textContent = content;
  parent.appendChild(element);
  return element;
}

/// An HTML element with a class and a text, appended to its parent.
function add(parent, name, kind, content) {
  const element = document.createElement(name);
  if (kind) element.className = kind;
  if (content !== undefined) element.textContent = content;
  parent.appendChild(element);
  return element;
}
