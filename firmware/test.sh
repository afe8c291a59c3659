#!/usr/bin/env bash
# Builds the firmware and the emulator, and runs their tests. Installs what is missing where it
# may, else says what to install. Prints the firmware's sizes.
#
#   firmware/test.sh
#
# The firmware is built again only when something in it has changed; the emulator shares what
# the main workspace has built (its target folder is the same).
set -euo pipefail
cd "$(dirname "$0")/.."

# For the machine code, and for the emulator around it.
firmware_packages=(rustc-web cargo-web rust-web-src libstd-rust-web-dev gcc-avr avr-libc binutils-avr)
emulator_packages=(libsimavr-dev libelf-dev libclang-dev pkg-config gcc libc6-dev)
packages=("${firmware_packages[@]}" "${emulator_packages[@]}")

step() { printf '\n== %s\n' "$*"; }
fail() { printf 'firmware/test.sh: %s\n' "$*" >&2; exit 1; }

step "firmware: tools"
command -v dpkg-query >/dev/null ||
  fail "firmware and emulator can't be built here: this needs Debian 12 or a relative of it, with: ${packages[*]}"
missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q '^install ok installed' ||
    missing+=("$package")
done
if [ ${#missing[@]} != 0 ]; then
  [ "$(id -u)" = 0 ] ||
    fail "packages are missing: sudo apt-get install --no-install-recommends ${missing[*]}"
  printf 'installing %s\n' "${missing[*]}"
  apt-get update -qq && apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null ||
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
) || fail "the firmware does not build with $(/usr/bin/rustc --version 2>/dev/null || echo "no /usr/bin/rustc")"
elf=$PWD/firmware/target/avr-none/release/sonard-firmware.elf
avr-size "$elf"

step "firmware: format, configuration, drawing"
cargo fmt --manifest-path emulator/Cargo.toml -- --check
find firmware/src firmware/board-config/src -name '*.rs' -exec rustfmt --check --edition 2024 {} +
timeout 900 cargo test --quiet --locked --manifest-path firmware/board-config/Cargo.toml
timeout 600 cargo run --quiet --locked --manifest-path firmware/board-config/Cargo.toml --bin wiring |
  diff - docs/wiring/wiring.svg ||
  fail "docs/wiring/wiring.svg is old: see docs/wiring/README.md for the command that makes it"

step "emulator: tests on the machine code"
# Without --locked: its lock file follows the main package's dependencies.
(
  cd emulator
  SONARD_FIRMWARE=$elf timeout 2400 cargo test --quiet -- --nocapture 2>&1 | grep -v '^Loaded '
)

step "sonard on the emulated board"
timeout 1200 cargo build --quiet --bin sonard
timeout 1200 cargo build --quiet --manifest-path emulator/Cargo.toml
target=${CARGO_TARGET_DIR:-$PWD/target}
folder=$(mktemp -d)
trap 'rm -rf "$folder"; [ -z "${emulated:-}" ] || kill "$emulated" 2>/dev/null || true' EXIT
"$target/debug/sonard" scan --emulator --scene simple-room --pose fig9 --to-deg 36 --max-range 4 \
  --out "$folder/scan"
grep -q '"provenance":"emulator"' "$folder/scan/scan.jsonl" || fail "the log does not say emulator"
SONARD_FIRMWARE=$elf "$target/debug/sonard-emulator" --scene simple-room --pose fig9 \
  --link "$folder/ranger" >/dev/null &
emulated=$!
for _ in $(seq 100); do [ ! -e "$folder/ranger" ] || break; sleep 0.1; done
"$target/debug/sonard" doctor --port "$folder/ranger" --pings 3
