#!/usr/bin/env bash
# How long a developer waits for the program after a line was changed in plots, in the command line, in the model.
#
#   benches/rebuild.sh                 of this folder
#   benches/rebuild.sh 4e94ead~1 HEAD  of commits: the first is the last one whose pure part was no crates
#
# In folders that are thrown away; `cargo build` once from nothing, which is not counted, then after each change.
set -euo pipefail
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# change NAME FILE...: a line more in the first of the files that is there, and what building after that takes.
change() {
  local name=$1 file began
  shift
  for file in "$@"; do
    if [ -e "$file" ]; then break; fi
  done
  printf '#[allow(dead_code)]\nconst fn changed() {}\n' >>"$file"
  began=$EPOCHREALTIME
  (
    cargo build --quiet
    times >"$work/times"
  )
  # The second line is of those that it started: user and system.
  tail -n 1 "$work/times" | tr 'ms' '  ' | awk -v name="$name" -v began="$began" -v ended="$EPOCHREALTIME" \
    '{printf "  %-6s %6.1f s, %6.1f s of processor time\n", name, ended - began, 60 * ($1 + $3) + $2 + $4}'
}

for what in "${@:-}"; do
  rm -rf "$work/source" "$work/target"
  mkdir "$work/source"
  if [ -n "$what" ]; then git archive "$what"; else git ls-files -z | tar --create --null --files-from -; fi |
    tar --extract --directory "$work/source"
  (
    cd "$work/source"
    export CARGO_TARGET_DIR=$work/target
    cargo build --locked --quiet
    printf '%s:\n' "${what:-this folder}"
    change plot crates/sonard-plot/src/lib.rs src/plot.rs src/plot/mod.rs
    change cli src/cli.rs src/cli/mod.rs
    change model crates/sonard-model/src/model.rs src/model.rs src/model/mod.rs
  )
done
