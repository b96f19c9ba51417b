#!/usr/bin/env bash
# Builds everything that is distributed, in one command: the FMUs' library for three platforms, the C sources, wheels and archives.
#
#   packaging/release.sh            writes target/dist/: kisspoint-*.whl (manylinux2014 x86-64, win_amd64), kisspoint-<platform>.tar.gz,
#                                   kisspoint-fmu-sources.tar.gz, SHA256SUMS
#   packaging/release.sh --untried  the same without trying the results, e.g. to compare the checksums of two machines
#
# Every wheel and the archives for x86-64 contain the libraries of all platforms, so that `kisspoint fmu` packs them all, and the module with which a report replays the plant
# in the browser. Needs what packaging/cross.sh and packaging/sources.sh need, and root, wine64 and qemu-user to try the results. The same commit and compilers give the same
# bytes. Each result is tried in a clean environment: without compiler, checkout or environment variables.
set -euo pipefail
cd "$(dirname "$0")/.."
ROOT=$PWD
DIST=$ROOT/target/dist
WORK=$ROOT/target/cross
LIBRARIES=$ROOT/target/fmu-libraries
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
fail() { echo "release.sh: $*" >&2; exit 1; }
rm -rf "$DIST" "$LIBRARIES" && mkdir -p "$DIST"

# Paths of the build machine are replaced by neutral names while compiling, so that none has to be removed later.
export KISSPOINT_PLACES=
export RUSTFLAGS="--remap-path-prefix=$ROOT=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo --remap-path-prefix=$(rustc --print sysroot)=rust"
packaging/cross.sh linux64 aarch64-linux win64
packaging/sources.sh
install -D -m 644 target/fmu-sources/kisspoint.wasm "$LIBRARIES/wasm32/kisspoint.wasm"

# The command for both systems that it supports, against the same old glibc and the same DLLs as the libraries.
CARGO=(--release --bin kisspoint --config profile.release.debug=0 --config 'profile.release.strip="symbols"')
export CARGO_TARGET_DIR=$WORK/cargo
PATH="$WORK/venv/bin:$PATH" cargo zigbuild "${CARGO[@]}" --target x86_64-unknown-linux-gnu.2.17
cargo build "${CARGO[@]}" --target x86_64-pc-windows-gnu
declare -A COMMAND=(
    [linux64]=$CARGO_TARGET_DIR/x86_64-unknown-linux-gnu/release/kisspoint
    [win64]=$CARGO_TARGET_DIR/x86_64-pc-windows-gnu/release/kisspoint.exe)
highest=$(readelf -V --wide "${COMMAND[linux64]}" | grep -oE 'GLIBC_[0-9.]+' | sort -uV | tail -1)
[ "$(printf '%s\nGLIBC_2.17\n' "$highest" | sort -V | tail -1)" = GLIBC_2.17 ] || fail "the command needs $highest"

"$WORK/venv/bin/pip" install -q "setuptools>=77" wheel
wheel() { # PLATFORM TAG
    # Files left by another platform's wheel would go into this one.
    rm -rf build
    KISSPOINT=${COMMAND[$1]} KISSPOINT_LIBRARIES=$LIBRARIES KISSPOINT_PLATFORM=$2 "$WORK/venv/bin/pip" wheel -q --no-deps --no-build-isolation -w "$DIST" .
    rm -rf build
}
wheel linux64 manylinux2014_x86_64
wheel win64 win_amd64

packed() { # NAME: the folder NAME below $WORK/archive
    tar -C "$WORK/archive" --sort=name --owner=0 --group=0 --numeric-owner --mode=u=rwX,go=rX --mtime="@$SOURCE_DATE_EPOCH" -cf - "$1" |
        gzip -n9 >"$DIST/$1.tar.gz"
}
rm -rf "$WORK/archive"
for platform in linux64 aarch64-linux win64; do
    folder=$WORK/archive/kisspoint-$platform
    mkdir -p "$folder"
    cp -R README.md LICENSE-MIT LICENSE-APACHE packaging/licenses "$folder/"
    if [[ -v COMMAND[$platform] ]]; then
        cp "${COMMAND[$platform]}" "$folder/"
        cp -R "$LIBRARIES" "$folder/libraries"
    else
        cp "$LIBRARIES/$platform"/* "$folder/"
    fi
    packed "kisspoint-$platform"
done
cp -R "$ROOT/target/fmu-sources" "$WORK/archive/kisspoint-fmu-sources"
rm "$WORK/archive/kisspoint-fmu-sources/kisspoint.wasm"
cp -R packaging/licenses "$WORK/archive/kisspoint-fmu-sources/"
packed kisspoint-fmu-sources
for file in "$LIBRARIES"/*/* "${COMMAND[@]}"; do
    for place in "$ROOT" "$HOME/"; do
        if grep -qaF "$place" "$file"; then fail "$file names $place"; fi
    done
done
(cd "$DIST" && sha256sum -- * >SHA256SUMS)
ls -l "$DIST"
[ "${1:-}" = --untried ] && exit

# The libraries of every platform, in a coupled launch.
bash tests/cross/run.sh

# The first steps of README.md.
clean=$(mktemp -d)
trap 'rm -rf "$clean"' EXIT
chmod 755 "$clean"
cp -R tests/data/campaigns/example "$clean/campaign"
first_steps() { # NAME COMMAND...
    local name=$1
    shift
    echo "$name: $("$@" --version | tr -d '\r')"
    "$@" launch --json >"$clean/launch.json"
    "$@" fmu --out "$name-fmus" >/dev/null
    "$@" replay campaign >/dev/null
    "$@" diagnose campaign --out "$name-answer" >/dev/null
    python3 - "$clean" "$name" <<'PYTHON'
import json, sys, zipfile

folder, name = sys.argv[1:]
time = json.load(open(f"{folder}/launch.json"))["table_ii"][2]["t_f_s"]
assert abs(time["deviation_percent"]) < 1, time
held = sorted(n for n in zipfile.ZipFile(f"{folder}/{name}-fmus/DrivelinePlant.fmu").namelist() if n.startswith("binaries/"))
answer = json.load(open(f"{folder}/{name}-answer/diagnosis.json"))
assert len(held) == 3 and answer["verdict"] == "explained", (held, answer["verdict"])
report = open(f"{folder}/{name}-answer/report.html", encoding="utf-8").read()
assert '"module":"' in report and len(report) < 2.5e6, "the plant is not in the report"
print(f"{name}: launch within {abs(time['deviation_percent']):.2f} %, {', '.join(held)}, diagnosis {answer['verdict']}")
PYTHON
}
cd "$clean"
python3 -m venv venv
venv/bin/pip install -q "$DIST"/*manylinux2014_x86_64.whl
first_steps wheel-linux64 env -i HOME="$clean" PATH="$clean/venv/bin" kisspoint
tar -xzf "$DIST/kisspoint-linux64.tar.gz"
first_steps archive-linux64 env -i HOME="$clean" PATH=/nowhere kisspoint-linux64/kisspoint
# pip itself unpacks the Windows wheel; wine, which does not run as root here, runs its content. Wine lacks one DLL that every Windows has.
venv/bin/pip install -q --target wheel-win64 --platform win_amd64 --only-binary :all: --no-deps "$DIST"/*win_amd64.whl
tar -xzf "$DIST/kisspoint-win64.tar.gz"
x86_64-w64-mingw32-gcc -O2 -shared -static "$ROOT/tests/cross/bcryptprimitives.c" -o bcryptprimitives.dll -ladvapi32
mkdir home && chown -R 65534:65534 "$clean"
as_nobody() {
    setpriv --reuid=65534 --regid=65534 --clear-groups env -i HOME="$clean/home" WINEPREFIX="$clean/home/wine" WINEDEBUG=-all PATH=/usr/lib/wine:/usr/bin:/bin "$@" </dev/null
}
as_nobody timeout 120 wine64 wineboot -i >wineboot.log 2>&1
install -m 644 bcryptprimitives.dll home/wine/drive_c/windows/system32/
first_steps wheel-win64 as_nobody timeout 600 wine64 wheel-win64/kisspoint/kisspoint.exe
first_steps archive-win64 as_nobody timeout 600 wine64 kisspoint-win64/kisspoint.exe
as_nobody wineserver64 -k || true
