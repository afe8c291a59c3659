#!/usr/bin/env bash
# Clippy for the other systems, whose parts no build for Linux compiles: macOS (the program and the papers' experiments),
# Windows (the verbs that need no device and no daemon). A system whose standard library can't be installed is left out, and
# named. The Python package, which has no parts of one system, is linted for Windows, or else for this one.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}

# has_target TARGET: the target's standard library is there, or has been installed.
has_target() {
  local sysroot
  sysroot=$(rustc --print sysroot)
  [ -d "$sysroot/lib/rustlib/$1/lib" ] || rustup --quiet target add "$1" >/dev/null 2>&1 ||
    { printf '%s: LEFT OUT, because its standard library is not installed (rustup target add %s)\n' "$1" "$1"; return 1; }
}

lint() { cargo clippy --locked --quiet "$@" -- -D warnings; }

if has_target aarch64-apple-darwin; then
  lint --target aarch64-apple-darwin --package sonard --package sonard-papers
  printf 'macOS: the program\n'
fi
if has_target x86_64-pc-windows-gnu; then
  lint --target x86_64-pc-windows-gnu --package sonard --no-default-features --features cli
  lint --target x86_64-pc-windows-gnu --manifest-path python/Cargo.toml
  printf 'Windows: the program without devices and daemon, the Python package\n'
else
  lint --manifest-path python/Cargo.toml
fi
