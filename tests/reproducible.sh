#!/usr/bin/env bash
# Builds artefacts of a release a second time, in a clone of the commit at another path, and compares them with those in
# target/dist byte for byte.
#
#   tests/reproducible.sh                   all of them
#   tests/reproducible.sh --only sbom,source   these; options are those of `cargo xtask dist`
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath "${CARGO_TARGET_DIR:-target}")
fail() { printf 'tests/reproducible.sh: %s\n' "$*" >&2; exit 1; }
[ -e "$target/dist/SHA256SUMS" ] || fail "no release in $target/dist: cargo xtask dist"
[ -z "$(git status --porcelain --untracked-files=no)" ] || fail "the checkout differs from its commit"
(cd "$target/dist" && sha256sum --quiet --check --ignore-missing SHA256SUMS)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
git clone --quiet --local . "$work/elsewhere"
# Installed tools have fixed versions and leave no path in what they build.
mkdir "$work/target"
ln -s "$target/tools" "$work/target/tools"
(cd "$work/elsewhere" && CARGO_TARGET_DIR=$work/target cargo xtask dist "$@" --out "$work/dist") >/dev/null
differences=0
for file in "$work"/dist/*; do
  name=$(basename "$file")
  if [ "$name" = SHA256SUMS ]; then continue; fi
  if cmp "$file" "$target/dist/$name"; then
    printf '%s: the same\n' "$name"
  else
    differences=$((differences + 1))
  fi
done
[ "$differences" = 0 ] || fail "$differences artefacts differ"
