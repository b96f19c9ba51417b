// The list of cars and their distribution. Everything that is drawn follows from `shown`, the places of the cars that pass the filters, in order.
document.documentElement.classList.add("js");
const F = JSON.parse(document.getElementById("fleet").textContent);
const N = F.name.length, $ = (id) => document.getElementById(id);
const VERDICTS = { no_gap: "no gap", explained: "explained", partly_explained: "partly explained", unexplained: "unexplained", inputs_do_not_fit: "inputs do not fit", error: "not diagnosed" };
const TONES = { no_gap: "good", explained: "", partly_explained: "warn", unexplained: "bad", inputs_do_not_fit: "bad", error: "bad" };
const all = Array.from({ length: N }, (_, i) => i);
const verdict = (i) => (F.error[i] ? "error" : F.verdict[i]);
const found = (i) => F.error[i] || F.effects[i].map((e, k) => [e, ...F.rivals[i][k]].map((id) => F.names[id] ?? id).join(" or ")).join(", ") || (F.where[i] ? `in ${F.in[F.where[i]] ?? F.where[i]}` : "–");
const text = all.map((i) => `${F.name[i]} ${F.error[i] ?? ""} ${(F.off[i] ?? []).join(" ")}`.toLowerCase());
const percent = (v) => (v === null ? "–" : `${Math.floor(100 * v)} %`.replace("-", "−"));
const figure = (v) => (v === null || v === undefined ? "–" : Number(v.toPrecision(3)).toString().replace("-", "−"));
// Under each other all have three digits.
const three = (v) => (!v || Math.abs(v) >= 1000 ? figure(v) : v.toPrecision(3).replace("-", "−"));
let shown = all, order = { key: "place", down: false };

const COLUMNS = [
  ["Car", "name", (i) => F.name[i], false],
  ["Verdict", "verdict", (i) => Object.keys(VERDICTS).indexOf(verdict(i)), false],
  ["Found", "found", found, false],
  ["Closed", "closed", (i) => F.closed[i], true],
  ["Gap, rad/s", "before", (i) => F.before[i], true],
  F.mileage_km.some((v) => v !== null) ? ["km", "mileage_km", (i) => F.mileage_km[i], true] : F.date.some((v) => v) ? ["Date", "date", (i) => F.date[i], true] : ["After, rad/s", "after", (i) => F.after[i], true],
];

function option(select, value, label) {
  const o = document.createElement("option");
  o.value = value;
  o.textContent = label;
  select.append(o);
}
function options(select, first, entries) {
  option(select, "", first);
  for (const [value, label, count] of entries) option(select, value, `${label} (${count})`);
}
const counts = (values) => values.reduce((m, v) => (v === null || v === undefined ? m : m.set(v, (m.get(v) ?? 0) + 1)), new Map());
const ranked = (map, label) => [...map].sort((a, b) => b[1] - a[1]).map(([v, c]) => [v, label(v), c]);
options($("verdict"), "any", ranked(counts(all.map(verdict)), (v) => VERDICTS[v] ?? v));
options($("where-is"), "anywhere", ranked(counts(F.where), (v) => F.places[v] ?? v));
options($("effect"), "any", ranked(counts(F.effects.flat()), (v) => F.names[v] ?? v));
$("outliers").closest("label").hidden = !F.off.some((o) => o?.length);

function filter() {
  const [find, v, w, e] = [$("find").value.trim().toLowerCase(), $("verdict").value, $("where-is").value, $("effect").value], out = $("outliers").checked;
  shown = all.filter((i) => (!find || text[i].includes(find)) && (!v || verdict(i) === v) && (!w || F.where[i] === w) && (!e || F.effects[i].includes(e)) && (!out || F.off[i]?.length));
  const column = COLUMNS.find((c) => c[1] === order.key);
  if (column) {
    const get = column[2], sign = order.down ? -1 : 1, keys = new Map(shown.map((i) => [i, get(i)]));
    // What has no value stands last, whichever way.
    shown.sort((a, b) => {
      const [x, y] = [keys.get(a), keys.get(b)];
      if (x === null || y === null) return (x === null) - (y === null) || a - b;
      return sign * (typeof x === "string" ? x.localeCompare(y, "en", { numeric: true }) : x - y) || a - b;
    });
  }
  $("count").textContent = shown.length === N ? `${N} cars` : `${shown.length} of ${N} cars`;
  $("window").scrollTop = 0;
  hover = -1;
  list();
  draw();
}

function head() {
  $("head").replaceChildren(...COLUMNS.map(([label, key, , num]) => {
    const cell = document.createElement("span"), button = document.createElement("button");
    cell.setAttribute("role", "columnheader");
    cell.setAttribute("aria-sort", order.key === key ? (order.down ? "descending" : "ascending") : "none");
    if (num) cell.className = "num";
    button.type = "button";
    button.textContent = label;
    button.onclick = () => {
      order = { key, down: order.key === key ? !order.down : num };
      head();
      filter();
      $("head").querySelectorAll("button")[COLUMNS.findIndex((c) => c[1] === key)].focus();
    };
    cell.append(button);
    return cell;
  }));
}

// Only the rows in sight exist.
let height = 0;
function list() {
  const box = $("window"), rows = $("rows");
  height ||= (() => {
    rows.append(row(0, 0));
    return rows.firstChild.getBoundingClientRect().height;
  })();
  rows.style.height = `${shown.length * height}px`;
  const first = Math.max(0, Math.floor(box.scrollTop / height) - 8), last = Math.min(shown.length, first + Math.ceil(box.clientHeight / height) + 16);
  const kept = document.activeElement?.dataset?.car;
  rows.replaceChildren(...shown.slice(first, last).map((i, k) => row(i, first + k)));
  $("list").setAttribute("aria-rowcount", shown.length + 1);
  if (kept) rows.querySelector(`[data-car="${kept}"]`)?.focus({ preventScroll: true });
}
function row(i, at) {
  const line = document.createElement("div");
  line.setAttribute("role", "row");
  line.setAttribute("aria-rowindex", at + 2);
  line.style.top = `${at * height}px`;
  if (F.off[i]?.length) line.className = "out";
  const cells = [null, null, found(i), percent(F.closed[i]), three(F.before[i]), COLUMNS[5][1] === "date" ? F.date[i] ?? "–" : COLUMNS[5][1] === "mileage_km" ? (F.mileage_km[i] === null ? "–" : Math.round(F.mileage_km[i]).toLocaleString("en")) : three(F.after[i])];
  cells.forEach((content, k) => {
    const cell = document.createElement("span");
    cell.setAttribute("role", "cell");
    if (k > 2) cell.className = "num";
    if (k === 0 && F.report[i]) {
      const link = document.createElement("a");
      link.href = F.report[i];
      link.textContent = F.name[i];
      link.dataset.car = i;
      cell.append(link);
    } else if (k === 0) cell.textContent = F.name[i];
    else if (k === 1) {
      const pill = document.createElement("span");
      pill.className = `pill ${TONES[verdict(i)] ?? ""}`;
      pill.textContent = VERDICTS[verdict(i)] ?? verdict(i);
      cell.append(pill);
    } else cell.textContent = content;
    if (k === 2) cell.title = [content, ...(F.off[i] ?? [])].join("\n");
    line.append(cell);
  });
  return line;
}

// The distribution: cars along one number, or that number over mileage or date.
// As the table has them: what is off most comes first.
const rows = [...document.querySelectorAll(".numbers tbody th code")].map((e) => e.textContent);
const place = (n) => (rows.includes(n) ? rows.indexOf(n) : rows.length);
const numbers = Object.keys(F.values).sort((a, b) => place(a) - place(b));
for (const n of numbers) option($("number"), n, n);
for (const [key, label] of [["before", "gap before, rad/s"], ["after", "gap after, rad/s"], ["closed", "share of the gap that is closed"]]) option($("number"), key, label);
option($("over"), "", "how many");
if (F.mileage_km.some((v) => v !== null)) option($("over"), "mileage_km", "mileage");
if (F.date.some((v) => v)) option($("over"), "date", "date");
const day = F.date.map((d) => (d ? Date.parse(d) / 864e5 : null));
const value = (i) => (F.values[$("number").value] ?? { value: F[$("number").value] }).value[i];
const unit = () => { const n = F.values[$("number").value]; return n ? n.unit || F.units[$("number").value] || "" : ""; };
let points = [], hover = -1;

function ticks(low, high, most) {
  const rough = (high - low) / most || 1, power = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].find((s) => s * power >= rough) * power, out = [];
  for (let t = Math.ceil(low / step) * step; t <= high + 1e-9 * step; t += step) out.push(Math.abs(t) < 1e-9 * step ? 0 : t);
  return out;
}
function range(values) {
  let low = Infinity, high = -Infinity;
  for (const v of values) { if (v < low) low = v; if (v > high) high = v; }
  const pad = 0.06 * (high - low) || Math.abs(low) * 0.1 || 1;
  return [low - pad, high + pad];
}
function draw() {
  const canvas = $("plot"), style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(`--${name}`).trim();
  const ratio = devicePixelRatio || 1, [w, h] = [canvas.clientWidth, canvas.clientHeight];
  if (!w) return;
  canvas.width = w * ratio;
  canvas.height = h * ratio;
  const g = canvas.getContext("2d");
  g.scale(ratio, ratio);
  g.font = "12px system-ui, sans-serif";
  const over = $("over").value, across = over === "date" ? day : F.mileage_km;
  const who = shown.filter((i) => Number.isFinite(value(i)) && value(i) !== null && (!over || across[i] !== null));
  $("hint").textContent = who.length ? `${who.length} cars have a value` : "No car in the list has a value of this number.";
  points = [];
  if (!who.length) return;
  const [left, right, top, bottom] = [over ? 64 : 16, w - 16, 12, h - 40], ink = colour("muted"), grid = colour("grid");
  const name = $("number").selectedOptions[0].textContent + (unit() ? `, ${unit()}` : "");
  if (over) {
    const [x0, x1] = range(who.map((i) => across[i])), [y0, y1] = range(who.map(value));
    const X = (v) => left + ((v - x0) / (x1 - x0)) * (right - left), Y = (v) => bottom - ((v - y0) / (y1 - y0)) * (bottom - top);
    g.fillStyle = ink;
    g.strokeStyle = grid;
    for (const t of ticks(y0, y1, 6)) { g.beginPath(); g.moveTo(left, Y(t)); g.lineTo(right, Y(t)); g.stroke(); g.textAlign = "right"; g.fillText(figure(t), left - 8, Y(t) + 4); }
    for (const t of ticks(x0, x1, 6)) { g.textAlign = "center"; g.fillText(over === "date" ? new Date(t * 864e5).toISOString().slice(0, 10) : t.toLocaleString("en"), X(t), bottom + 18); }
    g.textAlign = "left";
    g.fillText(`${name}  over ${over === "date" ? "date" : "mileage, km"}`, left, h - 6);
    // Least squares as a guide to the eye; the table above has the slope with its interval.
    if (who.length > 7) {
      const mx = who.reduce((s, i) => s + across[i], 0) / who.length, my = who.reduce((s, i) => s + value(i), 0) / who.length;
      const b = who.reduce((s, i) => s + (across[i] - mx) * (value(i) - my), 0) / who.reduce((s, i) => s + (across[i] - mx) ** 2, 0);
      if (Number.isFinite(b)) { g.strokeStyle = colour("after"); g.setLineDash([6, 4]); g.beginPath(); g.moveTo(X(x0), Y(my + b * (x0 - mx))); g.lineTo(X(x1), Y(my + b * (x1 - mx))); g.stroke(); g.setLineDash([]); }
    }
    points = who.map((i) => [X(across[i]), Y(value(i)), i]);
  } else {
    const [x0, x1] = range(who.map(value)), X = (v) => left + ((v - x0) / (x1 - x0)) * (right - left);
    g.fillStyle = ink;
    g.strokeStyle = grid;
    for (const t of ticks(x0, x1, 8)) { g.beginPath(); g.moveTo(X(t), top); g.lineTo(X(t), bottom); g.stroke(); g.textAlign = "center"; g.fillText(figure(t), X(t), bottom + 18); }
    g.textAlign = "left";
    g.fillText(name, left, h - 6);
    // Dots are heaped where they fall together.
    const size = Math.max(1, Math.min(7, Math.sqrt(((right - left) * (bottom - top)) / who.length) * 0.45)), heaps = new Map();
    for (const i of [...who].sort((a, b) => value(a) - value(b))) { const k = Math.round((X(value(i)) - left) / size); heaps.set(k, [...(heaps.get(k) ?? []), i]); }
    const tallest = Math.max(...[...heaps.values()].map((v) => v.length)), step = Math.min(size, (bottom - top - 6) / tallest);
    for (const [k, cars] of heaps) cars.forEach((i, at) => points.push([left + k * size, bottom - 4 - at * step, i]));
    if (x0 < 0 && x1 > 0) { g.strokeStyle = ink; g.beginPath(); g.moveTo(X(0), top); g.lineTo(X(0), bottom); g.stroke(); }
  }
  const radius = points.length > 3000 ? 2 : 3.2, [usual, outlier] = [colour("after"), colour("before")];
  g.globalAlpha = points.length > 1000 ? 0.55 : 0.8;
  for (const pass of [false, true]) {
    g.fillStyle = pass ? outlier : usual;
    for (const [x, y, i] of points) if (Boolean(F.off[i]?.length) === pass) { g.beginPath(); g.arc(x, y, radius, 0, 7); g.fill(); }
  }
  g.globalAlpha = 1;
  if (hover >= 0 && points[hover]) {
    const [x, y, i] = points[hover];
    g.strokeStyle = colour("ink");
    g.lineWidth = 2;
    g.beginPath();
    g.arc(x, y, radius + 3, 0, 7);
    g.stroke();
    const sd = F.values[$("number").value]?.sd[i];
    $("hint").textContent = `${F.name[i]}: ${figure(value(i))}${sd ? ` ± ${figure(sd)}` : ""} ${unit()} · ${VERDICTS[verdict(i)]}, ${found(i)}${F.off[i]?.length ? ` · outlier: ${F.off[i].join("; ")}` : ""}`;
  }
}
function nearest(event) {
  const box = $("plot").getBoundingClientRect(), [x, y] = [event.clientX - box.left, event.clientY - box.top];
  let best = -1, least = 400;
  points.forEach(([a, b], k) => { const d = (a - x) ** 2 + (b - y) ** 2; if (d < least) [best, least] = [k, d]; });
  return best;
}
const open = () => { const i = points[hover]?.[2]; if (i !== undefined && F.report[i]) location.href = F.report[i]; };
$("plot").onpointermove = (e) => { const k = nearest(e); if (k !== hover) { hover = k; draw(); } };
$("plot").onclick = (e) => { hover = nearest(e); open(); };
$("plot").onkeydown = (e) => {
  const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[e.key];
  if (by && points.length) { hover = (hover + by + points.length) % points.length; draw(); e.preventDefault(); }
  if (e.key === "Enter") open();
};
for (const id of ["number", "over"]) $(id).onchange = () => { hover = -1; draw(); };
for (const id of ["find", "verdict", "where-is", "effect", "outliers"]) $(id).oninput = filter;
$("clear").onclick = () => { for (const id of ["find", "verdict", "where-is", "effect"]) $(id).value = ""; $("outliers").checked = false; order = { key: "place", down: false }; head(); filter(); };
for (const button of document.querySelectorAll(".pick")) button.onclick = () => {
  $("where-is").value = button.dataset.where ?? "";
  $("effect").value = button.dataset.effect ?? "";
  filter();
  $("cars").scrollIntoView();
};
$("window").onscroll = () => requestAnimationFrame(list);
addEventListener("resize", () => { height = 0; list(); draw(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
head();
filter();
