#!/usr/bin/env bash
# Everything a change must pass. Installs what is missing where it may, else says what to install.
#
#   ./test.sh            all of it
#   FUZZ_SECONDS=60 ./test.sh   fuzz each target for a minute (default 5 s; 0 leaves fuzzing out)
#   FIRMWARE=0 ./test.sh        leave firmware and emulator out, where they can't be built: they
#                               need Debian's packages (firmware/test.sh)
#   PAGE=0 ./test.sh            leave the live page out, where there is no Chromium to look at it
#   AXE=0 ./test.sh             leave axe-core out of that, where there is no npm to get it with
#   FAKETIME=0 ./test.sh        leave the clock that is set out, where there is no libfaketime
#   PACKAGE=1 ./test.sh         build, install, upgrade and remove the Debian package, too; PACKAGE=all
#                               also cross-builds that for a Raspberry Pi and runs it in an emulator
#   SONARD_SOAK_FAULTS=1000 SONARD_KILLS=200 SONARD_COLLECT_KILLS=200 ./test.sh   longer runs of daemon
#                               and collection among faults
set -euo pipefail
cd "$(dirname "$0")"
fuzz_seconds=${FUZZ_SECONDS:-5}

step() { printf '\n== %s\n' "$*"; }
fail() { printf 'test.sh: %s\n' "$*" >&2; exit 1; }

step "tools"
command -v cargo >/dev/null || fail "cargo is missing: install Rust 1.90 or newer from https://rustup.rs"
if ! command -v cc >/dev/null || { [ "$fuzz_seconds" != 0 ] && ! command -v c++ >/dev/null; }; then
  if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    apt-get update -qq && apt-get install -y -qq --no-install-recommends gcc g++ libc6-dev
  else
    fail "a C linker and (for fuzzing) a C++ compiler are missing: sudo apt-get install gcc g++ libc6-dev"
  fi
fi
for component in rustfmt clippy; do
  cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1 || rustup component add "$component" ||
    fail "$component is missing: rustup component add $component"
done
step "format"
cargo fmt --all -- --check
cargo fmt --manifest-path fuzz/Cargo.toml -- --check

step "clippy, warnings denied"
cargo clippy --workspace --all-targets --quiet -- -D warnings

step "the pure part alone"
cargo clippy --lib --no-default-features --quiet -- -D warnings
tests/pure-tree.sh

step "systemd units"
systemd/test.sh

step "documentation, warnings denied"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet

if [ "$fuzz_seconds" != 0 ]; then
  step "fuzz targets, $fuzz_seconds s each"
  fuzz/smoke.sh "$fuzz_seconds" >"${TMPDIR:-/tmp}/sonard-fuzz.$$" 2>&1 || {
    tail -n 60 "${TMPDIR:-/tmp}/sonard-fuzz.$$"
    fail "a fuzz target found something: its input is in fuzz/artifacts"
  }
  rm -f "${TMPDIR:-/tmp}/sonard-fuzz.$$"
  printf 'no finding\n'
fi

if [ "${FIRMWARE:-1}" = 0 ]; then
  step "firmware and emulator: LEFT OUT, because FIRMWARE=0"
else
  firmware/test.sh || fail "firmware or emulator: see above. Where they can't be built, FIRMWARE=0 leaves them out"
fi

if [ "${FAKETIME:-1}" != 0 ] && ! ls /usr/lib/*/faketime/libfaketime.so.1 >/dev/null 2>&1; then
  if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    apt-get update -qq && apt-get install -y -qq --no-install-recommends libfaketime >/dev/null
  else
    fail "libfaketime is missing: sudo apt-get install libfaketime, or leave the test out with FAKETIME=0"
  fi
fi

if [ "${PAGE:-1}" != 0 ]; then
  step "a browser for the live page"
  if ! command -v chromium >/dev/null || ! command -v chromedriver >/dev/null; then
    if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
      apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium chromium-driver >/dev/null
    else
      fail "Chromium is missing: sudo apt-get install chromium chromium-driver, or leave the page out with PAGE=0"
    fi
  fi
  if [ "${AXE:-1}" = 0 ]; then printf 'axe-core: LEFT OUT, because AXE=0\n'; else tests/axe.sh; fi
fi

case ${PACKAGE:-0} in
1 | all)
  step "the Debian package"
  packaging/test.sh
  ;;
*) step "the Debian package: left to packaging/test.sh (PACKAGE=1 runs it here)" ;;
esac
if [ "${PACKAGE:-0}" = all ]; then
  step "the Debian package for a Raspberry Pi"
  packaging/test.sh arm64
fi

step "examples in the documentation"
cargo test --workspace --doc --quiet

if [ "${PAGE:-1}" = 0 ]; then
  step "the live page: LEFT OUT, because PAGE=0"
else
  # By itself: a browser takes the processors that tests of timing want.
  step "the live page in $(chromium --version)"
  cargo test --test cli --quiet live_page::
fi

step "tests"
cargo test --workspace --lib --bins --tests --quiet -- --skip live_page::
