# For packaging/cross.sh and packaging/sources.sh: need_rustc_web, which leaves a compiler with the sources of std at $WORK/rustc-web.
# shellcheck shell=bash

as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }

# Debian's newest rustc, unpacked beside rustup's: it brings std for AArch64 and the sources of std for Windows.
need_rustc_web() {
  [ -x "$WORK/rustc-web" ] && return
  local apt="-o APT::Architectures::=amd64 -o APT::Architectures::=arm64 -o Dir::State::lists=$WORK/apt/lists
    -o Dir::Cache=$WORK/apt/cache -o APT::Sandbox::User=root"
  mkdir -p "$WORK/deb" "$WORK/apt/lists/partial" "$WORK/apt/cache/archives/partial"
  # The lists are private: the machine's own architectures are left alone. Word splitting of $apt is wanted.
  as_root apt-get update
  # shellcheck disable=SC2086
  (cd "$WORK/deb" && rm -f ./*.deb && as_root apt-get $apt update && {
    version=$(apt-cache $apt policy rustc-web | awk '/Candidate/{print $2}')
    std=$(apt-cache $apt show libstd-rust-web-dev="$version" | grep -oE 'libstd-rust-web-[0-9.]+' | head -1)
    llvm=$(apt-cache $apt show "$std=$version" | grep -oE 'libllvm[0-9]+' | head -1)
    as_root apt-get $apt download rustc-web="$version" "$std=$version" libstd-rust-web-dev="$version" \
      rust-web-src="$version" libstd-rust-web-dev:arm64="$version"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$llvm"
  })
  rm -rf "$WORK/rustc-web-files" && mkdir -p "$WORK/rustc-web-files"
  for package in "$WORK"/deb/*.deb; do dpkg -x "$package" "$WORK/rustc-web-files"; done
  local usr=$WORK/rustc-web-files/usr
  printf '#!/bin/sh\nLD_LIBRARY_PATH=%s/lib/x86_64-linux-gnu${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} exec %s/bin/rustc "$@"\n' \
    "$usr" "$usr" >"$WORK/rustc-web"
  chmod +x "$WORK/rustc-web"
}
