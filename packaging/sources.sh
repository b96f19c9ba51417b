#!/usr/bin/env bash
# Makes the C sources of both FMUs, for targets that compile FMUs themselves: Simulink Coder, SCALEXIO, QNX and others. It also makes kisspoint.wasm, with which a report
# replays the plant in the browser.
#
#   packaging/sources.sh --module   makes kisspoint.wasm alone, which needs no wabt
#
#   packaging/sources.sh            writes target/fmu-sources/; `kisspoint fmu --sources target/fmu-sources` packs them
#
# The Rust sources are the only source: they are compiled to WebAssembly, which wabt's wasm2c translates to C99. The target needs neither Rust nor WebAssembly, only a C
# compiler and setjmp. Needs Debian's wabt (fetched), and rustup.
set -euo pipefail
cd "$(dirname "$0")/.."
ROOT=$PWD
WORK=${CARGO_TARGET_DIR:-$ROOT/target}/cross
OUT=${CARGO_TARGET_DIR:-$ROOT/target}/fmu-sources
mkdir -p "$WORK" "$OUT"

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
[ "${1:-}" = --module ] || command -v wasm2c >/dev/null || { as_root apt-get update && as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends wabt; }
rustup target add wasm32-unknown-unknown
# A small stack and memory; a panic ends in a trap, which the C side reports as fmi2Fatal.
CARGO_TARGET_DIR="$WORK/wasm" \
    RUSTFLAGS="-C link-arg=-zstack-size=65536 -C target-feature=-bulk-memory,-reference-types,-multivalue,-sign-ext,-nontrapping-fptoint -C target-cpu=mvp --remap-path-prefix=$ROOT=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo" \
    cargo build --release --lib --no-default-features --config profile.release.panic=\"abort\" --config 'profile.release.strip="symbols"' \
    --target wasm32-unknown-unknown
cp "$WORK/wasm/wasm32-unknown-unknown/release/kisspoint.wasm" "$OUT/"
[ "${1:-}" = --module ] && exit
wasm2c -n MODEL "$WORK/wasm/wasm32-unknown-unknown/release/kisspoint.wasm" -o "$OUT/kisspoint.c"
cp /usr/include/wasm-rt.h "$OUT/"
cp packaging/sources/*.[ch] "$OUT/"
# The GUIDs are written into the header, so that sources of another version can be recognised.
printf '/* %s */\n' $(strings -n 36 "$WORK/wasm/wasm32-unknown-unknown/release/kisspoint.wasm" | grep -oE '[0-9a-f]{8}-[0-9a-f]{4}-8[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}' | sort -u) >>"$OUT/kisspoint.h"
du -sh "$OUT"
