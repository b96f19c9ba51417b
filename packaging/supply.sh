#!/usr/bin/env bash
# Composition of the binaries: licences, sources and known vulnerabilities of every crate (cargo-deny), a bill of materials (CycloneDX), and a check that they contain no path
# of the machine that built them.
#
#   packaging/supply.sh [DIR]        writes kisspoint.cdx.json and kisspoint-fmu.cdx.json into DIR, out/ unless said otherwise
#
# Installs cargo-deny and cargo-cyclonedx below target/tools. The list of vulnerabilities comes from the network; without a network that check is left out, with a message. The
# tests check the licences without either (tests/python/test_licences.py).
set -euo pipefail
cd "$(dirname "$0")/.."

out=$(realpath -m "${1:-out}")
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
tools=$target/tools
export PATH=$tools/bin:$PATH
mkdir -p "$out"
tool() { command -v "$1" >/dev/null || CARGO_TARGET_DIR=$tools/build cargo install --quiet --locked --root "$tools" "$1@$2"; }

"${PYTHON:-python3}" packaging/licences.py --check

tool cargo-deny 0.18.5
cargo deny --log-level error check licenses bans sources
cargo deny --offline check advisories >/dev/null 2>&1 || cargo deny fetch db >/dev/null 2>&1 || fetched=no
if [[ ${fetched:-yes} == yes ]]; then cargo deny --log-level error check advisories; else echo "advisories: left out, the list of weaknesses cannot be had"; fi

tool cargo-cyclonedx 0.5.7
bill() {
    local name=$1
    shift
    cargo cyclonedx --quiet --format json --spec-version 1.5 --override-filename "$name.cdx" "$@"
    mv "$name.cdx.json" "$out/"
    rm -f "realcar/$name.cdx.json"
    echo "$out/$name.cdx.json: $(grep -c '"purl"' "$out/$name.cdx.json") components"
}
bill kisspoint
bill kisspoint-fmu --no-default-features

# The library as it is distributed, with neutral names for the paths of the build machine.
export RUSTFLAGS="${RUSTFLAGS:-} --remap-path-prefix=$PWD=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo --remap-path-prefix=$(rustc --print sysroot)=rust"
cargo build --quiet --release --lib --no-default-features --config profile.release.debug=0 --config 'profile.release.strip="symbols"'
library=$target/release/libkisspoint.so
for place in "$PWD" "$HOME/"; do
    if grep -qaF "$place" "$library"; then echo "supply.sh: $library names $place" >&2 && exit 1; fi
done
echo "$library: no path of this machine"
