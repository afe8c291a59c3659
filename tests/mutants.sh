#!/usr/bin/env bash
# Changes the pure core in a random sample of places, one at a time, and says which changes the unit
# tests of the changed crate notice (cargo-mutants; .cargo/mutants.toml says what counts as core).
#
#   tests/mutants.sh 300        a sample of 300, another each day
#   tests/mutants.sh 300 42     the sample of seed 42
#   JOBS=4 tests/mutants.sh 300 four at a time
#
# A copy of the repository is built and tested over and over: 300 take an hour and more. What was
# missed is listed at the end and in target/mutants.out/missed.txt.
set -euo pipefail
cd "$(dirname "$0")/.."
fail() { printf 'tests/mutants.sh: %s\n' "$*" >&2; exit 1; }
wanted=${1:?how many mutants?}
seed=${2:-$(date +%Y%m%d)}
version=27.0.0
target=${CARGO_TARGET_DIR:-target}

mutants=$(command -v cargo-mutants || echo "$target/tools/bin/cargo-mutants")
if [ ! -x "$mutants" ]; then
  cargo install --quiet --locked --debug --root "$target/tools" "cargo-mutants@$version"
fi
command -v openssl >/dev/null || fail "openssl is missing: sudo apt-get install openssl"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$mutants" mutants --workspace --list --line-col=true --colors=never >"$work/all"
# The same bytes for the same seed, without an end.
random() { openssl enc -aes-256-ctr -pbkdf2 -nosalt -pass "pass:$seed" </dev/zero 2>/dev/null; }
shuf --head-count="$wanted" --random-source=<(random) "$work/all" | sort >"$work/sample"
printf '%s of %s mutants, seed %s\n' "$(wc -l <"$work/sample")" "$(wc -l <"$work/all")" "$seed"

# The whole name of each, as a regular expression.
choice=()
while IFS= read -r name; do
  choice+=(--re "^$(sed 's/[][\\.*^$+?(){}|]/\\&/g' <<<"$name")\$")
done <"$work/sample"
runner=cargo
if cargo nextest --version >/dev/null 2>&1; then runner=nextest; fi
# Ends with 2 when some were missed and with 3 when some ran out of time, which is what is asked.
code=0
"$mutants" mutants --workspace --test-tool="$runner" --jobs="${JOBS:-1}" --output="$target" \
  --colors=never --no-times "${choice[@]}" || code=$?
case $code in 0 | 2 | 3) ;; *) fail "cargo-mutants ended with $code: see $target/mutants.out" ;; esac

count() { wc -l <"$target/mutants.out/$1.txt"; }
caught=$(($(count caught) + $(count timeout)))
viable=$((caught + $(count missed)))
printf '\nmissed:\n'
cat "$target/mutants.out/missed.txt"
printf '\n%d mutants: %d caught (%d of them by taking too long), %d missed, %d unviable; seed %s\n' \
  $((viable + $(count unviable))) "$caught" "$(count timeout)" "$(count missed)" "$(count unviable)" "$seed"
[ "$viable" = 0 ] || printf 'caught %d %% of the viable ones\n' $((100 * caught / viable))
