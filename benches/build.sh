#!/usr/bin/env bash
# What the program costs to build and to keep: seconds of processor time of a release build from nothing, and its size,
# stripped.
#
#   benches/build.sh                     of this folder
#   benches/build.sh b4550ee HEAD HEAD:mqtt,ros     of commits, with further features after a colon
#
# One after the other, in folders that are thrown away; sources of dependencies are fetched before. Compare lines of one
# run: the same build takes more on a computer with other work.
set -euo pipefail
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# measure NAME FOLDER FEATURES
measure() {
  (
    cd "$2"
    cargo fetch --locked --quiet
    export CARGO_TARGET_DIR=$work/target CARGO_INCREMENTAL=0
    rm -rf "$CARGO_TARGET_DIR"
    cargo build --release --locked --quiet --bin sonard --features "$3"
    times >"$work/times"
    strip -o "$work/sonard" "$CARGO_TARGET_DIR/release/sonard"
  )
  # The second line is of those that it started: user and system.
  local cpu_s
  cpu_s=$(tail -n 1 "$work/times" | tr 'ms' '  ' | awk '{printf "%.0f", 60 * $1 + $2}')
  printf '%8s s of processor time (user), %6.1f MB stripped: %s\n' "$cpu_s" \
    "$(stat -c %s "$work/sonard" | awk '{print $1 / 1e6}')" "$1"
}

if [ $# = 0 ]; then measure "this folder" . ""; fi
for what in "$@"; do
  commit=${what%%:*}
  features=
  if [ "$what" != "$commit" ]; then features=${what#*:}; fi
  mkdir "$work/source"
  git archive "$commit" | tar --extract --directory "$work/source"
  measure "$what" "$work/source" "$features"
  rm -rf "$work/source"
done
