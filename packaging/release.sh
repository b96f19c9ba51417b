#!/usr/bin/env bash
# Everything that is handed out, in one command: the FMUs' library for three platforms, the C sources, wheels and archives.
#
#   packaging/release.sh            writes target/dist/: kisspoint-*.whl (manylinux2014 x86-64), kisspoint-<platform>.tar.gz, SHA256SUMS
#
# Every wheel and archive holds the libraries of all platforms, so that `kisspoint fmu` packs them all. Needs what packaging/cross.sh and
# packaging/sources.sh need; the same commit gives the same bytes. The wheel is tried in an environment of its own, without a compiler on its path.
set -euo pipefail
cd "$(dirname "$0")/.."
ROOT=$PWD
DIST=$ROOT/target/dist
WORK=$ROOT/target/cross
LIBRARIES=$ROOT/target/fmu-libraries
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
rm -rf "$DIST" && mkdir -p "$DIST"

packaging/cross.sh linux64 aarch64-linux win64
packaging/sources.sh
# The command, against the same old glibc as the library.
PATH="$WORK/venv/bin:$PATH" CARGO_TARGET_DIR="$WORK/linux64" cargo zigbuild --release --bin kisspoint --config 'profile.release.strip="symbols"' --target x86_64-unknown-linux-gnu.2.17
COMMAND=$WORK/linux64/x86_64-unknown-linux-gnu/release/kisspoint

# One wheel per platform that has a command.
[ -x "$WORK/venv/bin/python" ] && "$WORK/venv/bin/pip" install -q "setuptools>=77" wheel
KISSPOINT=$COMMAND KISSPOINT_LIBRARY=$LIBRARIES/linux64/libkisspoint.so KISSPOINT_LIBRARIES=$LIBRARIES KISSPOINT_PLATFORM=manylinux2014_x86_64 \
    "$WORK/venv/bin/pip" wheel -q --no-deps --no-build-isolation -w "$DIST" .

# An archive per platform: the library, and for linux64 the command.
for platform in linux64 aarch64-linux win64; do
    folder=$WORK/archive/kisspoint-$platform
    rm -rf "$folder" && mkdir -p "$folder"
    cp "$LIBRARIES/$platform"/* README.md LICENSE-MIT LICENSE-APACHE "$folder/"
    if [ $platform = linux64 ]; then cp "$COMMAND" "$folder/"; fi
    tar -C "$WORK/archive" --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$SOURCE_DATE_EPOCH" -cf - "kisspoint-$platform" | gzip -n9 >"$DIST/kisspoint-$platform.tar.gz"
done
(cd "$DIST" && sha256sum -- * >SHA256SUMS)

# The wheel in a clean environment: README's first steps, without a compiler.
clean=$(mktemp -d)
trap 'rm -rf "$clean"' EXIT
python3 -m venv "$clean/venv"
"$clean/venv/bin/pip" install -q "$DIST"/*.whl
(cd "$clean" && env -i HOME="$clean" PATH="$clean/venv/bin" kisspoint launch --json >launch.json && env -i HOME="$clean" PATH="$clean/venv/bin" kisspoint fmu --out fmus)
"$clean/venv/bin/python" -c 'import json, sys; t = json.load(open(sys.argv[1]))["table_ii"][2]["t_f_s"]; assert abs(t["deviation_percent"]) < 1, t' "$clean/launch.json"
ls -l "$DIST"
