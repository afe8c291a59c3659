#!/bin/sh
# Shows that the device machine cannot panic: links it, optimised as for the firmware, with a
# panic handler that calls a function which does not exist.
set -eu
cd "$(dirname "$0")"
RUSTFLAGS="-Clink-arg=-nostartfiles -Clink-arg=-lc" \
  cargo build --release --target "$(rustc -vV | sed -n 's/^host: //p')"
