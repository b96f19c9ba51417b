#!/usr/bin/env bash
# Fuzzes the interfaces to the outside: sequences of FMI calls, serialized states, vehicle files, recordings.
#
#   packaging/fuzz.sh [SECONDS] [TARGET…]      15 s each of calls, states, vehicles and recordings unless said otherwise
#
# Starts from the seeds of fuzz/seeds and keeps its findings under target/fuzz-corpus. Exits with 1 at the first input that violates a promise, and says where that input is
# kept. A stable Rust suffices: RUSTC_BOOTSTRAP enables the nightly features that cargo-fuzz needs.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${1:-15}
shift || true
(($#)) || set -- calls states vehicles recordings
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
tools=$target/tools
export RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR=$target/fuzz PATH=$tools/bin:$PATH

if ! command -v cargo-fuzz >/dev/null; then
    CARGO_TARGET_DIR=$target/tools/build cargo install --quiet --locked --root "$tools" cargo-fuzz@0.13.1
fi
# If the sanitizer's runtime is missing (as in the Rust of some distributions), it runs without the sanitizer; violated promises are still found.
sanitizer=address
compgen -G "$(rustc --print sysroot)/lib/rustlib/*/lib/librustc*_rt.asan.a" >/dev/null || sanitizer=none

# All targets are built at once and the binaries are run directly, because cargo-fuzz would check every crate again for each target.
build=$target/fuzz-build.log
cargo fuzz build --fuzz-dir fuzz -D -s "$sanitizer" >"$build" 2>&1 || { tail -40 "$build" >&2; exit 1; }
built=$CARGO_TARGET_DIR/$(rustc -vV | sed -n 's/^host: //p')/debug

fuzz() {
    local name=$1 seeds=(fuzz/seeds/"$1")
    [[ $name == recordings ]] && seeds+=(tests/data/campaign/measurements tests/data/campaign/seed)
    local found=$target/fuzz-corpus/$name
    mkdir -p "$found"
    local log=$found.log
    if "$built/$name" "$found" "${seeds[@]}" \
        -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -artifact_prefix="$found-" >"$log" 2>&1; then
        echo "$name: $(grep -oE 'Done [0-9]+ runs in [0-9]+ second' "$log")s, sanitizer $sanitizer"
    else
        tail -40 "$log" >&2
        echo "fuzz.sh: $name failed; the input is beside $found, the log is $log" >&2
        return 1
    fi
}

# As many at a time as there are cores.
jobs=()
for name in "$@"; do
    ((${#jobs[@]} < $(nproc))) || { wait "${jobs[0]}"; jobs=("${jobs[@]:1}"); }
    fuzz "$name" &
    jobs+=($!)
done
for job in "${jobs[@]}"; do wait "$job"; done
