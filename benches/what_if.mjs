// How long the plant in a report takes for a replay of 5 s at 1 kHz, in V8 as in Chromium, by its processor time.
//
//   node benches/what_if.mjs out/diagnosis/report.html
import { readFileSync } from "node:fs";
import { gzipSync, gunzipSync } from "node:zlib";

const page = readFileSync(process.argv[2], "utf8");
const data = JSON.parse(/id="what-if-data">(.*?)<\/script>/s.exec(page)[1]);
const source = readFileSync(new URL("../src/report/plant.js", import.meta.url), "utf8").replace(/^const WHAT_IF = .*$/m, "");
const { plantItself } = new Function(source + "; return { plantItself };")();
const packed = data.drives.find(Boolean), drive = JSON.parse(gunzipSync(Buffer.from(packed, "base64")));
// The inputs of a recording, held, at 1 kHz; the last ones go on.
const time = Array.from({ length: 5001 }, (_, k) => k / 1000);
const at = (t) => Math.max(drive.time.findLastIndex((s) => s - drive.time[0] <= t), 0);
const long = { start: drive.start, time, inputs: drive.inputs.map((values) => time.map((t) => values[at(t)])), samples: null };
const play = await plantItself({ ...data, drives: [gzipSync(JSON.stringify(long)).toString("base64")] });
const size = data.effects[0].sizes[0], took = [];
for (let k = 0; k < 40; k++) {
  const before = process.cpuUsage();
  await play(0, [[size.reference, size.null + (size.found - size.null) * (k % 4) / 2]]);
  const spent = process.cpuUsage(before);
  took.push((spent.user + spent.system) / 1000);
}
took.splice(0, 8);
took.sort((a, b) => a - b);
console.log(`replay of 5 s at 1 kHz: least ${took[0].toFixed(1)} ms, median ${took[took.length >> 1].toFixed(1)} ms, most ${took.at(-1).toFixed(1)} ms`);
