// The reader drags the size of an effect; the curves follow.
const whatIf = { play: null, sizes: {}, effect: null, asked: 0, busy: false };
const box = document.getElementById("what-if");

/// Sizes that differ from what was found, by value reference.
function changed() {
  return WHAT_IF.effects.flatMap((e) => e.sizes.map((s, n) => [s.reference, whatIf.sizes[e.id][n], s.found])).filter(([, now, found]) => now !== found);
}

/// Replays the recording shown, unless a later wish has come: the page stays quick while the reader drags.
async function replayed() {
  whatIf.asked++;
  if (whatIf.busy || !box.open) return;
  whatIf.busy = true;
  for (let done = 0; done !== whatIf.asked;) {
    done = whatIf.asked;
    const began = performance.now(), k = state.recording;
    let curves = null, said;
    try {
      whatIf.play ??= WHAT_IF.module ? await plantItself(WHAT_IF) : madeBefore(WHAT_IF);
      curves = await whatIf.play(k, changed(), whatIf.effect.id, whatIf.sizes[whatIf.effect.id][0]);
      said = curves ? null : "There is no room in this page for a replay of this recording.";
    } catch (error) {
      said = "No replay: " + error.message;
    }
    const took = performance.now() - began;
    if (k !== state.recording) continue;
    show(curves);
    document.getElementById("what-if-said").textContent = said ?? `${shrunk()} ${WHAT_IF.module ? `Replayed in ${took.toFixed(0)} ms.` : ""}`;
    await new Promise(requestAnimationFrame);
  }
  whatIf.busy = false;
}

/// Car minus model of what is shown, in a sentence.
function shrunk() {
  const one = (c) => `${c.label} ${MODELS.map((m) => `${NAMES[m]} ${rounded(c.rms[m])}`).join(", ")} ${c.unit}`;
  return `Car minus model (rms): ${state.channels.filter((c) => c.column?.startsWith("omega")).map(one).join("; ")}.`;
}

/// Whether there is one curve more.
function withWhatIf(is) {
  for (const list of [CURVES, MODELS]) {
    const at = list.indexOf("whatif");
    if (is && at < 0) list.push("whatif");
    if (!is && at >= 0) list.splice(at, 1);
  }
  document.querySelector("[data-curve=whatif]").hidden = !is;
}

/// Adds the curves of a replay to those of the recording, or takes them away.
function show(curves) {
  withWhatIf(Boolean(curves));
  for (const c of state.measured) {
    const all = curves?.[c.column];
    const values = all && (all.length === c.times.length ? [...all] : c.index.map((i) => all[i]));
    for (const lists of [c.values, c.gaps, c.rms]) delete lists.whatif;
    if (!values) continue;
    c.values.whatif = values;
    c.gaps.whatif = c.values.real.map((r, i) => r - values[i]);
    c.rms.whatif = rms(c.gaps.whatif, 0, values.length - 1);
  }
  arrange();
  render();
}

/// Three significant digits, of whatever power of ten.
function sized(value) {
  if (!value || (Math.abs(value) >= 1e-3 && Math.abs(value) < 1e6)) return rounded(value);
  const [digits, power] = value.toExponential(2).split("e");
  return minus(digits) + "·10" + [...power].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? (c === "-" ? "⁻" : "")).join("");
}

/// The sliders of the effect chosen.
function offerSizes() {
  const room = document.getElementById("what-if-sizes");
  room.replaceChildren();
  whatIf.effect = WHAT_IF.effects.find((e) => e.id === document.getElementById("what-if-effect").value);
  const now = whatIf.sizes[whatIf.effect.id];
  whatIf.effect.sizes.forEach((size, n) => {
    const label = add(room, "label", "size");
    add(label, "span", "", size.label);
    const slider = add(label, "input");
    for (const [key, v] of [["type", "range"], ["min", size.low], ["max", size.high], ["step", WHAT_IF.module ? "any" : size.step], ["value", now[n]]]) slider.setAttribute(key, v);
    slider.dataset.size = n;
    const read = add(label, "output");
    const tell = () => {
      read.textContent = `${sized(now[n])}${size.unit ? " " + size.unit : ""}${now[n] === size.found ? " (as found)" : ""}`;
      slider.setAttribute("aria-valuetext", read.textContent);
    };
    slider.addEventListener("input", () => {
      const value = Number(slider.value);
      // As near to what was found as the hand can be.
      now[n] = Math.abs(value - size.found) < size.step / 2 ? size.found : value;
      tell();
      replayed();
    });
    slider.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (!way) return;
      event.preventDefault();
      slider.value = Math.min(Math.max(now[n] + way * size.step, size.low), size.high);
      slider.dispatchEvent(new Event("input"));
    });
    tell();
  });
}

function startWhatIf() {
  if (!box) return;
  for (const e of WHAT_IF.effects) whatIf.sizes[e.id] = e.sizes.map((s) => s.found);
  const turn = () => {
    // Of replays made beforehand, one effect is changed at a time.
    if (!WHAT_IF.module) for (const e of WHAT_IF.effects) whatIf.sizes[e.id] = e.sizes.map((s) => s.found);
    offerSizes();
    replayed();
  };
  document.getElementById("what-if-effect").addEventListener("change", turn);
  for (const button of box.querySelectorAll("button[data-size]")) button.addEventListener("click", () => {
    whatIf.sizes[whatIf.effect.id] = whatIf.effect.sizes.map((s) => s[button.dataset.size]);
    offerSizes();
    replayed();
  });
  box.addEventListener("toggle", () => (box.open ? turn() : show(null)));
  offerSizes();
}
