#!/usr/bin/env bash
# Builds the firmware and the emulator, and runs their tests. Installs what is missing where it
# may, else prints what to install. Prints the firmware's sizes.
#
#   firmware/test.sh          all of it
#   firmware/test.sh build    build the firmware and print its sizes
#   firmware/test.sh play     sonard on the emulated board; both are built
#
# The firmware is built again only when something in it has changed.
set -euo pipefail
cd "$(dirname "$0")/.."

# For the machine code, and for the emulator around it.
firmware_packages=(rustc-web cargo-web rust-web-src libstd-rust-web-dev gcc-avr avr-libc binutils-avr)
emulator_packages=(libsimavr-dev libelf-dev libclang-dev pkg-config gcc libc6-dev)
packages=("${firmware_packages[@]}" "${emulator_packages[@]}")

step() { printf '\n== %s\n' "$*"; }
fail() { printf 'firmware/test.sh: %s\n' "$*" >&2; exit 1; }

elf=$PWD/firmware/target/avr-none/release/sonard-firmware.elf
# Those of test.sh, so that nothing is built twice.
features=${FEATURES:-sonard-emulator/simavr}

get_tools() {
  step "firmware: tools"
  command -v dpkg-query >/dev/null ||
    fail "firmware and emulator can't be built here: this needs Debian 12 or a relative of it, with: ${packages[*]}"
  missing=()
  for package in "${packages[@]}"; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q '^install ok installed' ||
      missing+=("$package")
  done
  if [ ${#missing[@]} != 0 ]; then
    printf 'missing: %s\n' "${missing[*]}"
    tests/install.sh "leave firmware and emulator out with FIRMWARE=0" "${missing[@]}" || fail "could not install: ${missing[*]}"
  fi
  command -v cargo >/dev/null || fail "cargo is missing: install Rust 1.90 or newer from https://rustup.rs"
}

build_firmware() {
  step "firmware: build"
  # Debian's compiler has the AVR backend and its own library's source, which a release of Rust
  # compiles only with this variable. The variables of the host's build must not reach it.
  (
    cd firmware
    env -u RUSTC -u RUSTFLAGS -u CARGO_TARGET_DIR -u CARGO_BUILD_TARGET_DIR \
      PATH=/usr/bin:/bin RUSTC_BOOTSTRAP=1 timeout 1200 /usr/bin/cargo build --release --locked
  ) || fail "the firmware does not build with $(/usr/bin/rustc --version 2>/dev/null || echo "no /usr/bin/rustc")"
  avr-size "$elf"
  find firmware/src -name '*.rs' -exec rustfmt --check --edition 2024 {} +
}

test_machine_code() {
  step "configuration, drawing, tests on the machine code"
  SONARD_FIRMWARE=$elf timeout 2400 cargo test --workspace --features "$features" --quiet \
    --bin eeprom-image --bin wiring --test board -- --nocapture 2>&1 | grep -v '^Loaded '
}

play() {
  step "sonard on the emulated board"
  # Both programs as tests use them: built for those, they are not built once more.
  timeout 1800 cargo build --workspace --features "$features" --quiet --bin sonard --bin sonard-emulator
  target=${CARGO_TARGET_DIR:-$PWD/target}
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"; [ -z "${emulated:-}" ] || kill "$emulated" 2>/dev/null || true' EXIT
  "$target/debug/sonard" scan --emulator --scene simple-room --pose fig9 --to-deg 36 --max-range 4 \
    --out "$folder/scan"
  grep -q '"provenance":"emulator"' "$folder/scan/scan.jsonl" || fail "the provenance in the log is not emulator"
  SONARD_FIRMWARE=$elf "$target/debug/sonard-emulator" --scene simple-room --pose fig9 \
    --link "$folder/ranger" >/dev/null &
  emulated=$!
  for _ in $(seq 100); do [ ! -e "$folder/ranger" ] || break; sleep 0.1; done
  "$target/debug/sonard" doctor --port "$folder/ranger" --pings 3
}

case ${1:-} in
"")
  get_tools
  build_firmware
  test_machine_code
  play
  ;;
build)
  get_tools
  build_firmware
  ;;
play) play ;;
*) fail "all (no argument), build or play, not $1" ;;
esac
