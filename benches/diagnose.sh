#!/usr/bin/env bash
# Seconds and peak memory of `kisspoint diagnose` beside the same fits in Python (benches/peer/diagnose_peer.py).
#
#   benches/diagnose.sh [CAMPAIGN]
#
# Both run on two cores. The peer fits the nominal plant and 24 candidates and stops there; its compilation is not counted.
# Kisspoint's figure holds everything: reading, screening, fits, pairs where needed, location, report and FMU.
# Needs /usr/bin/time (GNU), and Python with numba and scipy (named by PYTHON); without these only Kisspoint's figures are printed.
set -euo pipefail
cd "$(dirname "$0")/.."

campaign=${1:-tests/data/campaigns/example}
kisspoint=${KISSPOINT:-${CARGO_TARGET_DIR:-target}/release/kisspoint}
python=${PYTHON:-python3}
runs=5

[[ -x $kisspoint ]] || { echo "benches/diagnose.sh: $kisspoint is missing; run \`cargo build --release\`, or set KISSPOINT" >&2; exit 1; }
[[ -x /usr/bin/time ]] || { echo "benches/diagnose.sh: /usr/bin/time is missing; apt-get install time" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for ((k = 0; k < runs; k++)); do
    /usr/bin/time -f '%e %M' -a -o "$work/times" "$kisspoint" diagnose "$campaign" --out "$work/out" --threads 2 >/dev/null
done
read -r seconds kilobytes < <(sort -n "$work/times" | sed -n "$((runs / 2 + 1))p")
echo "kisspoint diagnose: $seconds s (median of $runs), $((kilobytes / 1024)) MB"

if "$python" -c 'import numba, scipy' 2>/dev/null; then
    /usr/bin/time -f '%M' -o "$work/peer.memory" "$python" benches/peer/diagnose_peer.py "$campaign" --processes 2 --json >"$work/peer.json"
    "$python" - "$work/peer.json" "$seconds" "$(<"$work/peer.memory")" <<'PYTHON'
import json
import sys

peer, seconds, kilobytes = json.load(open(sys.argv[1])), float(sys.argv[2]), int(sys.argv[3])
print(f"python peer:        {peer['seconds']:.2f} s for {len(peer['fits'])} fits, {kilobytes // 1024} MB in its largest process")
print(f"ratio:              {peer['seconds'] / seconds:.1f}")
PYTHON
else
    echo "python peer:        skipped, $python has no numba and scipy"
fi
