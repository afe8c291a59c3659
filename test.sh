#!/usr/bin/env bash
# Everything a change must pass. Installs what is missing where it may, else says what to install.
#
#   ./test.sh            all of it
#   FUZZ_SECONDS=60 ./test.sh   fuzz each target for a minute (default 5 s; 0 leaves fuzzing out)
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
if [ "$fuzz_seconds" != 0 ] && ! cargo fuzz --version >/dev/null 2>&1; then
  cargo install --locked --quiet cargo-fuzz ||
    fail "cargo-fuzz could not be installed: cargo install cargo-fuzz, or set FUZZ_SECONDS=0"
fi

step "format"
cargo fmt --all -- --check
[ ! -d fuzz ] || cargo fmt --manifest-path fuzz/Cargo.toml -- --check

step "clippy, warnings denied"
cargo clippy --workspace --all-targets --quiet -- -D warnings

step "the pure part alone"
cargo clippy --lib --no-default-features --quiet -- -D warnings
tests/pure-tree.sh

step "documentation, warnings denied"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet

if [ "$fuzz_seconds" != 0 ] && [ -d fuzz ]; then
  step "fuzz targets, $fuzz_seconds s each"
  # libFuzzer's instrumentation is a nightly flag; a stable compiler takes it when told so.
  export RUSTC_BOOTSTRAP=1
  for target in $(cargo fuzz list); do
    cargo fuzz run --sanitizer none "$target" -- -max_total_time="$fuzz_seconds" -verbosity=0 -max_len=4096
    printf 'fuzz %s: no finding in %s s\n' "$target" "$fuzz_seconds"
  done
  unset RUSTC_BOOTSTRAP
fi

step "tests"
cargo test --workspace --quiet
