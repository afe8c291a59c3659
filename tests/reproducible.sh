#!/usr/bin/env bash
# Builds artefacts of a release a second time, in a copy of the checkout at another path, and compares them with those in
# target/dist byte for byte.
#
#   tests/reproducible.sh                   all of them
#   tests/reproducible.sh --only sbom,source   these; options are those of `cargo xtask dist`
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath "${CARGO_TARGET_DIR:-target}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
git clone --quiet --local . "$work/elsewhere"
(cd "$work/elsewhere" && CARGO_TARGET_DIR=$work/target cargo xtask dist "$@" --out "$work/dist") >/dev/null
(cd "$target/dist" && sha256sum --quiet --check --ignore-missing SHA256SUMS)
for file in "$work"/dist/*; do
  case $file in */SHA256SUMS) continue ;; esac
  cmp "$file" "$target/dist/$(basename "$file")"
  printf '%s: the same\n' "$(basename "$file")"
done
