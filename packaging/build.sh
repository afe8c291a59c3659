#!/usr/bin/env bash
# Builds the Debian package: `packaging/build.sh` for this computer, `packaging/build.sh arm64` for
# a Raspberry Pi (64 bit). Prints the package's path. cargo-deb is installed into target/tools if it
# is missing, and Debian's cross tools where that may be done.
set -euo pipefail
cd "$(dirname "$0")/.."
fail() { printf 'packaging/build.sh: %s\n' "$*" >&2; exit 1; }
target=${CARGO_TARGET_DIR:-target}
tools=$PWD/$target/tools

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
    /usr/bin/cargo build --release --quiet --features mqtt,ros,sqlite --bin sonard --target aarch64-unknown-linux-gnu
}

# Pages and completions are the same everywhere, and are written by the program itself.
cargo build --release --quiet --features mqtt,ros,sqlite --bin sonard
rm -rf "$target/package"
"$target/release/sonard" package-files "$target/package"

case ${1:-} in
"")
  "$tools/bin/cargo-deb" --no-build --strip --quiet ;;
arm64)
  build_for_arm64
  CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_STRIP=aarch64-linux-gnu-strip \
    "$tools/bin/cargo-deb" --no-build --strip --quiet --target aarch64-unknown-linux-gnu ;;
*)
  fail "for this computer (no argument) or for arm64, not $1" ;;
esac
