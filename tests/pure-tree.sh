#!/usr/bin/env bash
# Invariant 1: the library without features depends on nothing that does I/O or keeps time.
set -euo pipefail
cd "$(dirname "$0")/.."
tree=$(cargo tree --package sonard --no-default-features --edges normal --prefix none --format '{p}' | cut -d' ' -f1 | sort -u)
for banned in tokio tokio-serial serialport axum rppal mio rustix clap; do
  if grep -qx "$banned" <<<"$tree"; then
    printf 'pure-tree: %s is in the dependency tree of the pure part:\n' "$banned" >&2
    cargo tree --package sonard --no-default-features --edges normal --invert "$banned" >&2
    exit 1
  fi
done
printf 'pure part: %s crates, none of them tokio, serialport, axum or rppal\n' "$(wc -l <<<"$tree")"
