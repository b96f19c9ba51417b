#!/usr/bin/env bash
# What the C boundary of the plant's FMU costs, beside the same scheme by hand in C (benches/peer/plant.c).
#
#   bash benches/boundary.sh        builds the library in release, needs gcc and Python
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cargo build --quiet --profile quick --bin kisspoint
cargo build --quiet --release --lib --no-default-features
"$target/quick/kisspoint" fmu --out "$work" --library "$target/release/libkisspoint.so" >/dev/null
python3 -c 'import sys, zipfile; zipfile.ZipFile(sys.argv[1]).extractall(sys.argv[2])' "$work/DrivelinePlant.fmu" "$work/fmu"
guid=$(grep -o 'guid="[^"]*"' "$work/fmu/modelDescription.xml" | head -1 | cut -d'"' -f2)
cc -O2 benches/boundary.c -o "$work/boundary" -ldl
gcc -O3 benches/peer/plant.c -o "$work/peer" -lm
# Nine turns each, in alternation; the least counts, for what else the machine does can only add.
for _ in 1 2 3 4 5 6 7 8 9; do
    "$work/boundary" "$work/fmu/binaries/linux64/DrivelinePlant.so" "$guid" "file://$work/fmu/resources"
    echo "peer_step_ns $("$work/peer" | cut -d' ' -f1)"
done | awk '!($1 in least) || $2 < least[$1] { least[$1] = $2; if (!seen[$1]++) order[++n] = $1 }
    END { for (k = 1; k <= n; k++) print order[k], least[order[k]]
          printf "do_step_over_peer %.2f\n", least["do_step_ns"] / least["peer_step_ns"] }'
