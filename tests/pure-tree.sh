#!/usr/bin/env bash
# Invariant 1: the crates of the pure part depend on nothing that does I/O or keeps time.
set -euo pipefail
cd "$(dirname "$0")/.."
pure=(sonard-model sonard-records sonard-export sonard-generate sonard-import sonard-interpret sonard-inverse sonard-plot)
for crate in "${pure[@]}"; do
  tree=$(cargo tree --package "$crate" --edges normal --prefix none --format '{p}' | cut -d' ' -f1 | sort -u)
  for banned in tokio tokio-serial serialport axum rppal mio rustix clap sonard; do
    if grep -qx "$banned" <<<"$tree"; then
      printf 'pure-tree: %s is in the dependency tree of %s:\n' "$banned" "$crate" >&2
      cargo tree --package "$crate" --edges normal --invert "$banned" >&2
      exit 1
    fi
  done
done
printf '%s: none depends on tokio, serialport, axum or rppal\n' "${pure[*]}"
