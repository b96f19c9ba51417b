#!/usr/bin/env bash
# All tests, Rust and Python, from a fresh checkout. Exits with 1 if any fails, and says which group did.
# Needs Rust (cargo), a C compiler and Python 3.11 or later. As root on Debian it installs Chromium, Valgrind, wabt and an ARM compiler with its emulator by itself; tests whose
# tools are missing are skipped, with a message. All Rust code is built in one profile, `quick`, so that nothing is compiled twice.
set -euo pipefail
cd "$(dirname "$0")/.."

target=${CARGO_TARGET_DIR:-target}
# Everything is built only once, so incremental compilation would only slow the code down.
export CARGO_INCREMENTAL=0
python=${PYTHON:-python3}
summary=()
failed=0

need() { command -v "$1" >/dev/null || { echo "packaging/test.sh: $1 is missing; $2" >&2; exit 1; }; }
group() {
    local name=$1 begin=$SECONDS verdict=passed
    shift
    printf '\n== %s: %s\n' "$name" "$*"
    "$@" || { verdict=FAILED; failed=1; }
    summary+=("$(printf '%-34s %-7s %4d s' "$name" "$verdict" $((SECONDS - begin)))")
}
skipped() { summary+=("$(printf '%-34s skipped: %s' "$1" "$2")"); }

need cargo "install Rust 1.89 or later"
need cc "install a C compiler, e.g. apt-get install gcc"
need "$python" "install Python 3.11 or later, or name it in PYTHON"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "packaging/test.sh: $python is older than 3.11" >&2; exit 1; }

debian=()
command -v chromium >/dev/null && command -v chromedriver >/dev/null || debian+=(chromium chromium-driver)
command -v valgrind >/dev/null || debian+=(valgrind)
# C sources of the FMUs, here and on a 32-bit ARM.
command -v wasm2c >/dev/null || debian+=(wabt)
command -v arm-linux-gnueabihf-gcc >/dev/null && command -v qemu-arm >/dev/null || debian+=(gcc-arm-linux-gnueabihf libc6-dev-armhf-cross qemu-user)
if ((${#debian[@]})) && [[ $(id -u) == 0 ]] && command -v apt-get >/dev/null; then
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${debian[@]}"; } >/dev/null ||
        echo "could not install ${debian[*]}: the tests that need them are skipped" >&2
fi

if [[ ! -x $target/venv/bin/python ]]; then "$python" -m venv "$target/venv"; fi
requirements=(tests/python/requirements*.txt)
"$target/venv/bin/pip" install --quiet --disable-pip-version-check "${requirements[@]/#/-r}"

group "Rust: build" cargo build --profile quick --workspace --all-targets
group "Rust: tests" cargo test --profile quick --workspace --no-fail-fast
if command -v valgrind >/dev/null; then
    group "C: misuse under Valgrind" cargo test --profile quick --test fmi_abuse -- --ignored
else
    skipped "C: misuse under Valgrind" "valgrind is not installed"
fi
# The headers of FMI 2.0, which bindgen reads for the crate fmi-sys, need a libclang, which comes from the Python package registry.
libclang=$("$target/venv/bin/python" -c 'import clang.native, os; print(os.path.dirname(clang.native.__file__))' 2>/dev/null || true)
if [[ -n $libclang ]]; then
    [[ $libclang == /* ]] || libclang=$PWD/$libclang
    group "Rust: against fmi-sys" env LIBCLANG_PATH="$libclang" BINDGEN_EXTRA_CLANG_ARGS="-I$(cc -print-file-name=include)" \
        CARGO_TARGET_DIR="$target/fmi_sys" cargo test --manifest-path tests/fmi_sys/Cargo.toml
else
    skipped "Rust: against fmi-sys" "libclang is not to be had"
fi
group "Rust: fuzzing, 10 s each" bash packaging/fuzz.sh 10
# Lists the mutants of the last commit that no test would notice, for information; it never fails the run.
group "Rust: mutants of the last commit" bash -c 'MINUTES=10 bash packaging/mutants.sh --changed || echo "ended with $?"'
# Made again each time, because otherwise sources of another version might be tested.
if command -v wasm2c >/dev/null && rustup target add wasm32-unknown-unknown >/dev/null 2>&1; then
    group "C sources of the FMUs" bash packaging/sources.sh
else
    rm -rf "$target/fmu-sources"
    skipped "C sources of the FMUs" "wabt or std for wasm32-unknown-unknown is not to be had; packaging/sources.sh says more"
fi
# The library as it is distributed, without the parts that only the command needs; it goes into the FMUs that the Python tests load. Built in the command's target folder, it
# would make cargo rebuild everything else.
fmu_library() {
    CARGO_TARGET_DIR=$target/fmus cargo build --profile quick --lib --no-default-features &&
        cp --remove-destination "$target/fmus/quick/libkisspoint.so" "$target/quick/"
}
group "Rust: library of the FMUs" fmu_library
export KISSPOINT=$PWD/$target/quick/kisspoint KISSPOINT_PROFILE=quick
[[ $target == /* ]] && KISSPOINT=$target/quick/kisspoint
group "Python: tests" "$target/venv/bin/python" -m pytest -q -rs --durations=15 --numprocesses auto --dist loadfile tests/python

printf '\n== Summary\n'
printf '%s\n' "${summary[@]}"
exit "$failed"
