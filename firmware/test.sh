#!/usr/bin/env bash
# Builds the firmware and the emulator, and runs their tests. Installs what is missing where it
# may, else says what to install. Prints the firmware's sizes.
#
#   firmware/test.sh
set -euo pipefail
cd "$(dirname "$0")/.."

packages=(
  rustc-web cargo-web rust-web-src libstd-rust-web-dev gcc-avr avr-libc binutils-avr
  libsimavr-dev libelf-dev libclang-dev pkg-config gcc libc6-dev
)

step() { printf '\n== %s\n' "$*"; }
fail() { printf 'firmware/test.sh: %s\n' "$*" >&2; exit 1; }

step "firmware: tools"
command -v dpkg-query >/dev/null ||
  fail "this needs Debian 12 or a relative of it, with: ${packages[*]}"
missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q '^install ok installed' ||
    missing+=("$package")
done
if [ ${#missing[@]} != 0 ]; then
  [ "$(id -u)" = 0 ] ||
    fail "packages are missing: sudo apt-get install --no-install-recommends ${missing[*]}"
  apt-get update -qq && apt-get install -y -qq --no-install-recommends "${missing[@]}" ||
    fail "could not install: ${missing[*]}"
fi
command -v cargo >/dev/null || fail "cargo is missing: install Rust 1.90 or newer from https://rustup.rs"

step "firmware: build"
# Debian's compiler has the AVR backend and its own library's source, which a release of Rust
# compiles when told so. The variables of the host's build must not reach it.
(
  cd firmware
  env -u RUSTC -u RUSTFLAGS -u CARGO_TARGET_DIR -u CARGO_BUILD_TARGET_DIR \
    PATH=/usr/bin:/bin RUSTC_BOOTSTRAP=1 timeout 1200 /usr/bin/cargo build --release --locked
)
elf=$PWD/firmware/target/avr-none/release/sonard-firmware.elf
avr-size "$elf"

step "firmware: configuration and drawing"
timeout 600 cargo test --quiet --locked --manifest-path firmware/board-config/Cargo.toml
timeout 600 cargo run --quiet --locked --manifest-path firmware/board-config/Cargo.toml --bin wiring |
  diff - docs/wiring/wiring.svg ||
  fail "docs/wiring/wiring.svg is old: see docs/wiring/README.md for the command that makes it"

step "emulator: tests on the machine code"
(
  cd emulator
  cargo fmt -- --check
  SONARD_FIRMWARE=$elf timeout 2400 cargo test --quiet --locked -- --nocapture 2>&1 | grep -v '^Loaded '
)
