// Decoding, scales and drawing: functions that know nothing of the page's state.
const DATA = JSON.parse(document.getElementById("series").textContent);
const CURVES = DATA.retuned ? ["real", "before", "after"] : ["real", "before"];
const MODELS = CURVES.slice(1);
const NAMES = { real: "car", before: DATA.retuned ? "before" : "model", after: "after", whatif: "what if" };

/// Integers from bytes in base 64: steps in sevens of bits, doubled with the sign last, one added; NaN for zero.
function unpack(text) {
  const bytes = atob(text), out = [];
  for (let k = 0, level = 0; k < bytes.length; k++) {
    let value = 0, weight = 1, byte;
    do {
      byte = bytes.charCodeAt(k);
      value += (byte & 127) * weight;
      weight *= 128;
    } while (byte & 128 && ++k);
    if (value) {
      const step = value - 1;
      level += step % 2 ? -(step + 1) / 2 : step / 2;
    }
    out.push(value ? level : NaN);
  }
  return out;
}

/// Curves of a channel from its integers: times in s, values in the channel's unit, NaN where the car has a gap.
function decode(channel, dt) {
  const steps = unpack(channel.real), index = channel.index ? unpack(channel.index) : null;
  const times = steps.map((_, i) => (index ? index[i] : i) * dt);
  const real = steps.map((v) => v * channel.q);
  const gap = (name) => unpack(channel[name]).map((k) => k * channel.q);
  const gaps = { before: gap("before"), after: gap("after") };
  const model = (name) => real.map((r, i) => r - gaps[name][i]);
  return { column: channel.column, label: channel.label, unit: channel.unit, noise: channel.noise, samples: channel.samples, thinned: Boolean(index), index,
    curves: CURVES, rms: { before: channel.rms[0] ?? NaN, after: channel.rms[1] ?? NaN },
    times, gaps, values: { real, before: model("before"), after: model("after") } };
}

/// A channel that has no model: what drove the car, or what follows from its speeds.
function alone(label, unit, times, values, curves = { real: values }) {
  return { label, unit, times, values: curves, gaps: {}, rms: {}, curves: Object.keys(curves), alone: true };
}

/// Signals that drove the recording, its slip, and the torque that the flywheel has in the car and lacks in the model.
function beside(recording, channels, flywheel) {
  const of = (column) => channels.find((c) => c.column === column);
  const out = recording.inputs.map((s) => {
    const values = unpack(s.values).map((v) => v * s.q);
    return alone(s.label, s.unit, values.map((_, i) => i * s.step * recording.dt), values);
  });
  const [f, c] = [of("omega_f_rad_s"), of("omega_c_rad_s")];
  if (f && c && f.times.length === c.times.length && !f.thinned) {
    const slip = (k) => f.values[k].map((v, i) => v - c.values[k][i]);
    out.push(alone("Slip", "rad/s", f.times, [], Object.fromEntries(CURVES.map((k) => [k, slip(k)]))));
  }
  if (f && flywheel) {
    const lacking = (k) => f.times.map((_, i) => {
      let a = i, b = i;
      while (a > 0 && f.times[i] - f.times[a] < 0.05) a--;
      while (b < f.times.length - 1 && f.times[b] - f.times[i] < 0.05) b++;
      return b > a ? flywheel[0] * (f.gaps[k][b] - f.gaps[k][a]) / (f.times[b] - f.times[a]) + flywheel[1] * f.gaps[k][i] : NaN;
    });
    out.push(alone("Unexplained torque on the flywheel", "N·m", f.times, [], Object.fromEntries(MODELS.map((k) => [k, lacking(k)]))));
  }
  return out;
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
  return { low, high, a, b, at: (v) => a + (v - low) / (high - low) * (b - a), back: (p) => low + (p - a) / (b - a) * (high - low) };
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
  const value = power * [8, 6, 5, 4, 3, 2, 1].find((m) => m * power <= reach * 1.000001);
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

/// Samples per point of the screen from which each stretch is drawn by its first, least, greatest and last value.
const CROWDED = 4;

function path(times, values, x, y, from, to) {
  const width = Math.abs(x.b - x.a) || 1, crowded = to - from > CROWDED * width, stride = crowded ? Math.ceil((to - from) / width) : 1;
  let out = "", pen = "M";
  const point = (i) => {
    if (!Number.isFinite(values[i])) { pen = "M"; return; }
    out += pen + x.at(times[i]).toFixed(1) + " " + y.at(values[i]).toFixed(1);
    pen = "L";
  };
  for (let i = from; i <= to; i += stride) {
    if (!crowded) { point(i); continue; }
    const end = Math.min(i + stride - 1, to);
    let least = i, most = i;
    for (let k = i; k <= end; k++) {
      if (values[k] < values[least] || !Number.isFinite(values[least])) least = k;
      if (values[k] > values[most] || !Number.isFinite(values[most])) most = k;
    }
    for (const k of [...new Set([i, least, most, end])].sort((a, b) => a - b)) point(k);
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
