#!/usr/bin/env bash
# Builds the Debian package and prints its path:
#
#   packaging/build.sh         for this computer
#   packaging/build.sh arm64   for a Raspberry Pi (64 bit)
#   packaging/build.sh dev     for this computer, around the program that the tests use: for tests of what the package
#                              does, not to be given to anybody
#   packaging/build.sh tools   no package, but what makes one
#
# cargo-deb is installed into target/tools if it is missing, and Debian's cross tools where that may be done.
set -euo pipefail
cd "$(dirname "$0")/.."
fail() { printf 'packaging/build.sh: %s\n' "$*" >&2; exit 1; }
target=${CARGO_TARGET_DIR:-target}
tools=$(realpath --canonicalize-missing "$target")/tools

if [ ! -x "$tools/bin/cargo-deb" ]; then
  # A program that packs files once: building it takes longer than it runs.
  cargo install --quiet --debug --locked --root "$tools" cargo-deb@3.8.0 >&2
fi

# Debian's own cargo has the standard library of other architectures; rustup's may lack it.
build_for_arm64() {
  if ! dpkg --print-foreign-architectures | grep -qx arm64 || ! [ -x /usr/bin/aarch64-linux-gnu-gcc ] ||
    ! dpkg -s libstd-rust-web-dev:arm64 >/dev/null 2>&1; then
    [ "$(id -u)" = 0 ] || fail "cross tools are missing: sudo dpkg --add-architecture arm64, then sudo apt-get \
install rustc-web cargo-web libstd-rust-web-dev:arm64 gcc-aarch64-linux-gnu libc6-dev-arm64-cross"
    dpkg --add-architecture arm64
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends rustc-web cargo-web libstd-rust-web-dev:arm64 \
      gcc-aarch64-linux-gnu libc6-dev-arm64-cross >&2
  fi
  PATH=/usr/bin:/bin CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \
    /usr/bin/cargo build --release --quiet --features full --bin sonard --target aarch64-unknown-linux-gnu
}

# prepare PROFILE: builds the program and has it write pages and completions, which are the same everywhere.
prepare() {
  local folder=$1
  case $1 in
  release) cargo build --release --quiet --features full --bin sonard ;;
  dev)
    # As tests build it, with the features of the other one.
    folder=debug
    [ -x "$target/debug/sonard" ] || cargo build --quiet --features full
    ;;
  esac
  rm -rf "$target/package"
  "$target/$folder/sonard" package-files "$target/package"
}

case ${1:-} in
"")
  prepare release
  "$tools/bin/cargo-deb" --no-build --strip --quiet
  ;;
arm64)
  prepare release
  build_for_arm64
  CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_STRIP=aarch64-linux-gnu-strip \
    "$tools/bin/cargo-deb" --no-build --strip --quiet --target aarch64-unknown-linux-gnu
  ;;
dev)
  prepare dev
  # cargo-deb wants no profile that is meant for work, so the program gets a folder as another one would have it.
  install -D "$target/debug/sonard" "$target/packaged-dev/sonard"
  "$tools/bin/cargo-deb" --profile packaged-dev --no-build --strip --fast --quiet
  ;;
tools) ;;
*)
  fail "for this computer (no argument), arm64, dev or tools, not $1" ;;
esac
