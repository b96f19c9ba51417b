#!/usr/bin/env bash
# Builds the FMUs' shared library for every platform on a Debian 12 x86-64 machine with rustup's stable toolchain, and asserts properties that importers rely on: the highest
# glibc symbol, the DLL's imports, the exported functions.
#
#   packaging/cross.sh [linux64] [aarch64-linux] [win64]      all three if none is named
#
# The libraries are written to target/fmu-libraries/<platform>/. `kisspoint fmu --library A --library B …` packs them. Downloads go to target/cross. The ordinary build needs
# none of this.
set -euo pipefail
ROOT=$(cd "$(dirname "$0")/.." && pwd)
WORK=$ROOT/target/cross
OUT=$ROOT/target/fmu-libraries
export CARGO_TARGET_DIR=$WORK/cargo
GLIBC=2.17
ZIG=ziglang==0.17.0
ZIGBUILD=cargo-zigbuild==0.24.0
mkdir -p "$WORK"
cd "$ROOT"

CARGO=(--release --lib --no-default-features --config profile.release.debug=0 --config 'profile.release.strip="symbols"')
fail() { echo "cross.sh: $*" >&2; exit 1; }

# zig, from the Python package registry, links against an old glibc.
need_zig() {
  [ -x "$WORK/venv/bin/cargo-zigbuild" ] && return
  python3 -m venv "$WORK/venv"
  "$WORK/venv/bin/pip" install -q "$ZIGBUILD" "$ZIG" || "$WORK/venv/bin/pip" install -q cargo-zigbuild ziglang
}

assert_exports() { # PLATFORM TOOL-OUTPUT
  local count
  count=$(grep -oE '\bfmi2[A-Z][A-Za-z]+' <<<"$2" | sort -u | wc -l)
  [ "$count" = 44 ] || fail "$1 exports $count functions of FMI 2.0, not 44"
}

assert_glibc() { # PLATFORM FILE
  local highest
  highest=$(readelf -V --wide "$2" | grep -oE 'GLIBC_[0-9.]+' | sort -uV | tail -1)
  [ "$(printf '%s\nGLIBC_%s\n' "$highest" $GLIBC | sort -V | tail -1)" = GLIBC_$GLIBC ] || fail "$1 needs $highest"
  readelf -d "$2" | grep -q 'libgcc_s' && fail "$1 needs libgcc_s"
  assert_exports "$1" "$(readelf --dyn-syms --wide "$2" | awk '$7 != "UND" {print $8}')"
  echo "$1: highest symbol $highest, no libgcc_s, 44 functions, $(stat -c %s "$2") bytes"
}

assert_dll() { # FILE
  local imports
  imports=$(x86_64-w64-mingw32-objdump -p "$1" | awk '/DLL Name/{print tolower($3)}')
  for name in $imports; do
    case $name in
      kernel32.dll | ntdll.dll | msvcrt.dll | userenv.dll | ws2_32.dll | bcryptprimitives.dll | advapi32.dll | bcrypt.dll | api-ms-win-core-synch-*) ;;
      *) fail "win64 imports $name, which is not a system library of Windows" ;;
    esac
  done
  assert_exports win64 "$(x86_64-w64-mingw32-objdump -p "$1" | sed -n '/Ordinal\/Name Pointer/,$p')"
  echo "win64: imports $(echo $imports), 44 functions, $(stat -c %s "$1") bytes"
}

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }

build_linux() { # PLATFORM TRIPLE
  need_zig
  PATH="$WORK/venv/bin:$PATH" cargo zigbuild "${CARGO[@]}" --target "$2.$GLIBC"
  install -D "$CARGO_TARGET_DIR/$2/release/libkisspoint.so" "$OUT/$1/libkisspoint.so"
  assert_glibc "$1" "$OUT/$1/libkisspoint.so"
}

build_win64() {
  command -v x86_64-w64-mingw32-gcc >/dev/null ||
    { as_root apt-get update && as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends gcc-mingw-w64-x86-64-win32; }
  cargo build "${CARGO[@]}" --target x86_64-pc-windows-gnu
  install -D "$CARGO_TARGET_DIR/x86_64-pc-windows-gnu/release/kisspoint.dll" "$OUT/win64/kisspoint.dll"
  assert_dll "$OUT/win64/kisspoint.dll"
}

[ $# -gt 0 ] || set -- linux64 aarch64-linux win64
for platform in "$@"; do
  case $platform in
    linux64) triple=x86_64-unknown-linux-gnu ;;
    aarch64-linux) triple=aarch64-unknown-linux-gnu ;;
    win64) triple=x86_64-pc-windows-gnu ;;
    *) fail "unknown platform $platform" ;;
  esac
  rustup target add $triple
  if [ "$platform" = win64 ]; then build_win64; else build_linux "$platform" $triple; fi
done
