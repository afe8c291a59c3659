#!/usr/bin/env bash
# Makes the pictures of the README. Run it after a change that may change them, and look at them.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet
sonard=target/release/sonard
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for pose in fig7 fig9; do
  "$sonard" scan --mock --scene simple-room --pose "$pose" --seed 1 --out "$work/$pose" 2>/dev/null
  "$sonard" plot "$work/$pose/scan.jsonl" -o "docs/pictures/simple-room-$pose.png" --width 1200
done
ls -l docs/pictures
