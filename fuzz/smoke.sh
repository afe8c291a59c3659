#!/bin/sh
# Runs every fuzz target for a bounded time: fuzz/smoke.sh [seconds each] [target...]
# Needs no cargo-fuzz and no nightly: the coverage that libFuzzer steers by comes from LLVM
# options that a stable compiler takes as well. For longer hunts with the address sanitizer:
# RUSTC_BOOTSTRAP=1 cargo fuzz run <target>. FUZZ_SEED=1 fixes the random numbers.
set -eu
cd "$(dirname "$0")"
seconds=${1:-20}
[ $# -eq 0 ] || shift
targets=${*:-$(sed -n 's/^name = "\([a-z_]*\)"$/\1/p' Cargo.toml)}
triple=$(rustc -vV | sed -n 's/^host: //p')
coverage="--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4
  -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table
  -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1 -Cdebug-assertions -Coverflow-checks"
RUSTFLAGS=$(echo $coverage) cargo build --release --target "$triple"
binaries=${CARGO_TARGET_DIR:-target}/$triple/release

# A slow input counts by processor time: libFuzzer's limit is wall-clock time, which a busy machine exceeds as well.
is_slow() { ! (ulimit -t 10 && "$binaries/$target" -timeout=1000 "$1"); }

for target in $targets; do
  mkdir -p "corpus/$target" "artifacts/$target" "seeds/$target"
  "$binaries/$target" "corpus/$target" "seeds/$target" -max_total_time="$seconds" -max_len=4096 -timeout=10 \
    -seed="${FUZZ_SEED:-0}" \
    -artifact_prefix="artifacts/$target/" -print_final_stats=1 || {
    for input in "artifacts/$target"/*; do
      case $input in */timeout-*) if ! is_slow "$input"; then rm "$input" && continue; fi ;; esac
      printf 'finding of target %s, as base64: %s\n' "$target" "$(base64 -w 0 "$input")"
      exit 1
    done
  }
done
