#!/usr/bin/env bash
# The main job, from a fresh checkout: the paper's launch, both FMUs, and the diagnosis of a bundled campaign.
# Needs Rust (cargo) and a C compiler. Everything that it writes is under out/ and target/.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${1:-out}
campaign=${2:-tests/data/campaigns/example}
step() { printf '\n== %s\n' "$*"; }
need() { command -v "$1" >/dev/null || { echo "packaging/demo.sh: $1 is missing; $2" >&2; exit 1; }; }

need cargo "install Rust 1.89 or later"
need cc "install a C compiler, e.g. apt-get install gcc"

step "Build the command, and the library that goes into the FMUs"
cargo build --profile quick --bin kisspoint
cargo build --release --lib --no-default-features
# The plant for browsers, with which the report replays recordings at other sizes of effects; without it the report has replays made beforehand.
if command -v rustup >/dev/null && rustup target add wasm32-unknown-unknown >/dev/null 2>&1; then packaging/sources.sh --module; fi
kisspoint=${CARGO_TARGET_DIR:-target}/quick/kisspoint
export KISSPOINT_LIBRARY=${CARGO_TARGET_DIR:-target}/release/libkisspoint.so

step "The start-up of the paper beside its Table II"
"$kisspoint" launch --plots "$out/figures"

step "Both FMUs"
"$kisspoint" fmu --out "$out"

step "Drive the plant with the recordings of $campaign: the gap"
"$kisspoint" replay "$campaign"

step "Diagnose the gap"
"$kisspoint" diagnose "$campaign" --out "$out/diagnosis"

step "Done"
echo "Open $out/diagnosis/report.html in a browser; the FMUs are in $out, the paper's figures in $out/figures."
