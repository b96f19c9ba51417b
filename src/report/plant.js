// What replays a recording with other sizes of an effect: the plant itself, driven as an importer drives the FMU, or replays that were made beforehand.
const WHAT_IF = JSON.parse(document.getElementById("what-if-data").textContent);

async function unzip(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

/// An instance of the plant: a function of a recording's number and of sizes by value reference that gives, by column, a value for each sample.
async function plantItself({ module, guid, vehicle, start, inputs, outputs, drives }) {
  const words = new TextEncoder(), drive = [];
  let said = "";
  const log = (...[, , , , message]) => {
    const bytes = new Uint8Array(c.memory.buffer, message);
    said = new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  };
  const { instance } = await WebAssembly.instantiate(await unzip(module), { env: { kisspoint_log: log } });
  const c = instance.exports;
  const must = (status) => { if (status > 1) throw new Error(said || `status ${status}`); };
  const view = (Type, at, length) => new Type(c.memory.buffer, at, length);
  const room = (Type, values) => {
    const at = c.kisspoint_allocate(values.length * Type.BYTES_PER_ELEMENT);
    view(Type, at, values.length).set(values);
    return at;
  };
  const text = (t) => room(Uint8Array, words.encode(t + "\0"));
  const callbacks = room(Uint32Array, [c.kisspoint_logger(), 0, 0, 0, 0]);
  const plant = c.fmi2Instantiate(text("plant"), 1, text(guid), text("data:application/json," + vehicle), callbacks, 0, 1);
  if (!plant) throw new Error(said || "the plant does not start");
  const [inputRefs, outputRefs, sizeRefs] = [inputs, outputs.map((o) => o[1]), new Array(256).fill(0)].map((r) => room(Uint32Array, r));
  const [inputRoom, outputRoom, sizeRoom] = [inputs.length, outputs.length, 256].map((n) => room(Float64Array, new Array(n).fill(0)));
  const set = (sizes) => {
    view(Uint32Array, sizeRefs, sizes.length).set(sizes.map((s) => s[0]));
    view(Float64Array, sizeRoom, sizes.length).set(sizes.map((s) => s[1]));
    must(c.fmi2SetReal(plant, sizeRefs, sizes.length, sizeRoom));
  };
  return async (k, sizes) => {
    if (!drives[k]) return null;
    drive[k] ??= JSON.parse(new TextDecoder().decode(await unzip(drives[k])));
    const { start: from, time, inputs: driven, samples } = drive[k], count = samples?.length ?? time.length;
    must(c.fmi2Reset(plant));
    must(c.fmi2SetupExperiment(plant, 0, 0, 0, 0, 0));
    set([...start.map((r, n) => [r, from[n]]), ...inputs.map((r, n) => [r, driven[n][0]]), ...sizes]);
    must(c.fmi2EnterInitializationMode(plant));
    must(c.fmi2ExitInitializationMode(plant));
    const found = outputs.map(() => new Float64Array(count));
    let out = view(Float64Array, outputRoom, outputs.length), held = view(Float64Array, inputRoom, inputs.length);
    for (let i = 0, tick = 0; i < count; i++) {
      must(c.fmi2GetReal(plant, outputRefs, outputs.length, outputRoom));
      // Where the module has asked for more memory, what was seen of it before is gone.
      if (!out.length) [out, held] = [view(Float64Array, outputRoom, outputs.length), view(Float64Array, inputRoom, inputs.length)];
      for (let n = 0; n < outputs.length; n++) found[n][i] = out[n];
      for (const until = i + 1 < count ? samples?.[i + 1] ?? i + 1 : tick; tick < until; tick++) {
        for (let n = 0; n < inputs.length; n++) held[n] = driven[n][tick];
        must(c.fmi2SetReal(plant, inputRefs, inputs.length, inputRoom));
        must(c.fmi2DoStep(plant, time[tick] - time[0], time[tick + 1] - time[tick], 1));
      }
    }
    return Object.fromEntries(outputs.map(([column], n) => [column, found[n]]));
  };
}

/// The same of replays that lie in the page, for one effect at one of its sizes.
function madeBefore({ replays, effects }) {
  return async (k, _, id, size) => {
    const { low, step } = effects.find((e) => e.id === id).sizes[0];
    const curves = replays[k][id]?.[Math.round((size - low) / step)];
    if (!curves) return null;
    // They lie there as gaps to the car's curve, in the units of the recording's channels.
    return Object.fromEntries(RECORDINGS[k].channels.map((channel) => {
      const real = unpack(channel.real);
      return [channel.column, unpack(curves[channel.column]).map((gap, i) => (real[i] - gap) * channel.q)];
    }));
  };
}
