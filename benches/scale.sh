#!/usr/bin/env bash
# How the time and memory of `kisspoint diagnose` grow with the campaign.
#
#   benches/scale.sh
#
# Prints processor time, elapsed time and peak memory on two threads for the bundled campaign once, twice, four and eight times over (9 to 72 recordings), and
# for the drives of a drawn car, about 40 minutes at 100 Hz and about an hour, and for an hour in a single drive. Copies of a recording count as recordings of their own, so that only the
# size differs; that their noise is the same makes an answer surer than it should be, and does not matter here. Needs /usr/bin/time (GNU) and python3.
set -euo pipefail
cd "$(dirname "$0")/.."

kisspoint=${KISSPOINT:-${CARGO_TARGET_DIR:-target}/release/kisspoint}
[[ -x $kisspoint ]] || { echo "benches/scale.sh: $kisspoint is missing; run \`cargo build --release\`, or set KISSPOINT" >&2; exit 1; }
[[ -x /usr/bin/time ]] || { echo "benches/scale.sh: /usr/bin/time is missing; apt-get install time" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

repeated() { # FROM TO RECORDINGS: as many recordings, those of FROM over and over
    python3 - "$@" <<'PYTHON'
import json, pathlib, shutil, sys

source, target, count = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), int(sys.argv[3])
target.mkdir()
shutil.copy(source / "vehicle.json", target)
recordings = json.loads((source / "recordings.json").read_text())
names, all_of_them = sorted(recordings), {}
for k in range(count):
    name = names[k % len(names)]
    copy = f"{name}x{k // len(names)}"
    all_of_them[copy] = recordings[name]
    # The same measurement twice would be refused: each copy differs in the sixth digit of one sample.
    head, *rows = (source / f"{name}.csv").read_text().splitlines()
    cells = rows[0].split(",")
    cells[1] = f"{float(cells[1]) + 1e-6 * (k // len(names)):.6f}"
    (target / f"{copy}.csv").write_text("\n".join([head, ",".join(cells), *rows[1:]]) + "\n")
(target / "recordings.json").write_text(json.dumps(all_of_them))
PYTHON
}
timed() { # LABEL CAMPAIGN
    /usr/bin/time -f '%U %S %e %M' -o "$work/time" "$kisspoint" diagnose "$2" --json --threads 2 >/dev/null
    awk -v label="$1" '{ printf "%-40s %7.1f s of processor, %7.1f s elapsed, %5.0f MB\n", label, $1 + $2, $3, $4 / 1024 }' "$work/time"
}

for times in 1 2 4 8; do
    repeated tests/data/campaigns/example "$work/bench-$times" $((9 * times))
    timed "$((9 * times)) recordings of a bench" "$work/bench-$times"
done
# A drawn car whose drives are logged at 100 Hz.
for drives in 48 72; do
    "$kisspoint" blind --road --cars 1 --seed 4 --drives "$drives" --draw-only --keep "$work/road-$drives" >/dev/null
    timed "$drives drives, $(($(cat "$work/road-$drives"/case_001/*.csv | wc -l) / 6000)) min at 100 Hz" "$work/road-$drives/case_001"
done
"$kisspoint" blind --road --cars 1 --seed 4 --drives 1 --drive-length 3600 --draw-only --keep "$work/road-1" >/dev/null
timed "1 drive, 60 min at 100 Hz" "$work/road-1/case_001"
