#!/usr/bin/env bash
# Runs the coupled launch on every library that packaging/cross.sh has built: win64 under wine, aarch64 under qemu. All must
# agree with linux64 to 1e-12.
set -euo pipefail
ROOT=$(cd "$(dirname "$0")/../.." && pwd)
LIBRARIES=$ROOT/target/fmu-libraries
WORK=${TMPDIR:-/tmp}/kisspoint-cross-$$ # an ordinary user must be able to reach it: wine does not run as root here
mkdir -p "$WORK" && trap 'rm -rf "$WORK"' EXIT
cd "$ROOT/tests/cross"
guid() { # MODEL: the GUID is a constant of the build
  local table
  table=$(find "$ROOT/target/cross" -path '*/build/kisspoint-*' -name "$1.rs" -printf '%T@ %p\n' | sort -n | tail -1 | cut -d' ' -f2)
  grep 'pub const GUID' "$table" | cut -d'"' -f2
}
GUIDS=("$(guid DrivelinePlant)" "$(guid ClutchController)")
need() { # COMMAND PACKAGES...
  command -v "$1" >/dev/null || [ -x "/usr/lib/wine/$1" ] && return
  shift
  apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"
}
as_nobody() {
  setpriv --reuid=65534 --regid=65534 --clear-groups env HOME="$WORK/nb" WINEPREFIX="$WORK/nb/wp" WINEDEBUG=-all \
    PATH=/usr/lib/wine:/usr/bin:/bin "$@" </dev/null
}

cc -O2 launch.c -o "$WORK/launch" -ldl
"$WORK/launch" "$LIBRARIES/linux64/libkisspoint.so" "${GUIDS[@]}" >"$WORK/linux64"

need qemu-aarch64 qemu-user gcc-aarch64-linux-gnu libc6-dev-arm64-cross
need aarch64-linux-gnu-gcc gcc-aarch64-linux-gnu libc6-dev-arm64-cross
aarch64-linux-gnu-gcc -O2 launch.c -o "$WORK/launch-aarch64" -ldl
qemu-aarch64 -L /usr/aarch64-linux-gnu "$WORK/launch-aarch64" "$LIBRARIES/aarch64-linux/libkisspoint.so" "${GUIDS[@]}" >"$WORK/aarch64-linux"

need x86_64-w64-mingw32-gcc gcc-mingw-w64-x86-64-win32
need wine64 wine64
x86_64-w64-mingw32-gcc -O2 -static launch.c -o "$WORK/launch.exe"
x86_64-w64-mingw32-gcc -O2 -shared -static bcryptprimitives.c -o "$WORK/bcryptprimitives.dll" -ladvapi32
cp "$LIBRARIES/win64/kisspoint.dll" "$WORK/"
chmod 755 "$WORK" && chmod 644 "$WORK"/*.dll && chmod 755 "$WORK"/*.exe
mkdir "$WORK/nb" && chown 65534:65534 "$WORK/nb"
as_nobody timeout 120 wine64 wineboot -i >"$WORK/wineboot.log" 2>&1
install -m 644 "$WORK/bcryptprimitives.dll" "$WORK/nb/wp/drive_c/windows/system32/"
as_nobody timeout 120 wine64 "Z:${WORK//\//\\}\\launch.exe" "Z:${WORK//\//\\}\\kisspoint.dll" "${GUIDS[@]}" | tr -d '\r' >"$WORK/win64"
as_nobody wineserver64 -k || true

for platform in aarch64-linux win64; do
  paste -d' ' "$WORK/linux64" "$WORK/$platform" | awk -v name="$platform" '
    { d = $3 - $6; if (d < 0) d = -d; s = $3 < 0 ? -$3 : $3; r = s > 1e-9 ? d / s : d; if (r > worst) worst = r; if ($1 $2 != $4 $5) exit 1 }
    END { printf "%s: %d values, worst relative difference to linux64 %.1e\n", name, NR, worst; exit !(NR == 16 && worst < 1e-12) }'
done
