#!/usr/bin/env bash
# Changes the pure core in places spread evenly over it, one at a time, and prints which changes the unit tests of the
# changed crate do not notice (cargo-mutants; .cargo/mutants.toml defines the core).
#
#   tests/mutants.sh 300         every n-th change there is, 300 in all or some more
#   tests/mutants.sh 300 7       the same from the eighth on: samples of other numbers have none in common
#
# The same command again goes on where it was stopped, and tries once more what was missed: what was caught or does
# not compile is kept in target/mutants/300-7/ as long as the changed code stays where it is.
#
# A copy of the repository below TMPDIR is built and tested over and over, each time one crate and its unit tests
# alone. JOBS=2 takes two copies.
set -euo pipefail
cd "$(dirname "$0")/.."
export LC_ALL=C
fail() { printf 'tests/mutants.sh: %s\n' "$*" >&2; exit 1; }
wanted=${1:?how many mutants?}
number=${2:-0}
version=27.0.0
target=${CARGO_TARGET_DIR:-target}

mutants=$(command -v cargo-mutants || echo "$target/tools/bin/cargo-mutants")
if [ ! -x "$mutants" ]; then
  cargo install --quiet --locked --debug --root "$target/tools" "cargo-mutants@$version"
fi
out=$target/mutants/$wanted-$number
last=$out/mutants.out
mkdir -p "$last"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The sample. By name, because a sharded run can't be gone on with.
"$mutants" mutants --workspace --list --line-col=true --colors=never >"$work/listed"
every=$(($(wc -l <"$work/listed") / wanted))
if [ "$every" -lt 1 ]; then every=1; fi
awk -v every="$every" -v from="$((number % every))" 'NR % every == (from + 1) % every' "$work/listed" |
  sort >"$work/sample"
sort "$work/listed" | comm -23 - "$work/sample" >"$work/others"

# Adds what the last run found to what is known of the sample.
gather() {
  for kind in caught timeout unviable; do
    touch "$out/$kind" "$last/$kind.txt"
    sort -u "$out/$kind" "$last/$kind.txt" | comm -12 - "$work/sample" >"$work/$kind"
    cp "$work/$kind" "$out/$kind"
  done
  sort "$work/caught" "$work/timeout" "$work/unviable" | comm -13 - "$work/sample" >"$work/left"
}
gather
total=$(wc -l <"$work/sample")
printf '%d of %d mutants, sample %s; %d left to try\n' \
  "$total" "$(wc -l <"$work/listed")" "$number" "$(wc -l <"$work/left")"

if [ -s "$work/left" ]; then
  runner=cargo
  if cargo nextest --version >/dev/null 2>&1; then runner=nextest; fi
  cat "$work/others" "$work/caught" "$work/timeout" "$work/unviable" >"$last/previously_caught.txt"
  began=$SECONDS
  # Ends with 2 when some were missed and with 3 when some ran out of time, which is expected.
  code=0
  CARGO_PROFILE_DEV_DEBUG=none "$mutants" mutants --workspace --iterate --test-tool="$runner" \
    --jobs="${JOBS:-1}" --output="$out" --colors=never --no-times || code=$?
  case $code in 0 | 2 | 3) ;; *) fail "cargo-mutants ended with $code: see $last" ;; esac
  printf '%d s\n' $((SECONDS - began))
  gather
fi

printf '\nmissed:\n'
cat "$work/left"
# By crate and the module in it.
printf '\n%-32s %7s %7s %7s %9s %7s\n' "" caught timeout missed unviable share
for kind in caught timeout unviable left; do
  sed -E "s|^crates/([^/]+)/src/([a-z_]+).*|$kind \1::\2|" "$work/$kind"
done | awk '
  { of[$2] = 1; count[$2, $1]++; all[$1]++ }
  function line(name, caught, timeout, missed, unviable,   viable, share) {
    viable = caught + timeout + missed
    share = viable ? sprintf("%d %%", 100 * (caught + timeout) / viable) : "-"
    return sprintf("%-32s %7d %7d %7d %9d %7s", name, caught, timeout, missed, unviable, share)
  }
  END {
    for (name in of) {
      print line(name, count[name, "caught"], count[name, "timeout"], count[name, "left"], count[name, "unviable"]) | "sort"
    }
    close("sort")
    print line("all", all["caught"], all["timeout"], all["left"], all["unviable"])
  }'
