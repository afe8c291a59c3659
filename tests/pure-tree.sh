#!/usr/bin/env bash
# Invariant 1: the crates of the pure part depend on nothing that does I/O or keeps time.
set -euo pipefail
cd "$(dirname "$0")/.."
pure=(sonard-model sonard-records sonard-export sonard-floorplan sonard-generate sonard-import sonard-interpret sonard-inverse sonard-plot sonard-survey)
# check CRATE BANNED...
check() {
  local crate=$1 tree banned
  shift
  tree=$(cargo tree --package "$crate" --edges normal --prefix none --format '{p}' | cut -d' ' -f1 | sort -u)
  for banned in "$@"; do
    if grep -qx "$banned" <<<"$tree"; then
      printf 'pure-tree: %s is in the dependency tree of %s:\n' "$banned" "$crate" >&2
      cargo tree --package "$crate" --edges normal --invert "$banned" >&2
      exit 1
    fi
  done
}
shell=(
  tokio tokio-serial serialport axum rppal mio sonard sonard-api sonard-collect sonard-daemon sonard-device sonard-mock
  sonard-runtime
)
for crate in "${pure[@]}"; do check "$crate" "${shell[@]}" rustix clap; done
# With files, and the first with options.
check sonard-papers "${shell[@]}"
check sonard-log "${shell[@]}" clap
# The emulator runs boards; it needs the mock's world and no daemon.
check sonard-emulator axum sonard sonard-daemon sonard-log
printf '%s: none depends on tokio, serialport, axum or rppal\n' "${pure[*]} sonard-papers sonard-log"
