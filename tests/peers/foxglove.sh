#!/usr/bin/env bash
# Receives the daemon's live messages with Foxglove's own client library and compares every field with the daemon's log
# of the same scans (foxglove.mjs).
#
#   tests/peers/foxglove.sh [PROGRAM]    without a program, it is built
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/peers/foxglove-tools.sh
program=$(realpath "${1:-${CARGO_TARGET_DIR:-target}/debug/sonard}")
if [ $# = 0 ]; then cargo build --quiet --features full; fi

work=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill "$daemon" 2>/dev/null || true; rm -rf "$work"' EXIT
(umask 077 && head -c 16 /dev/urandom | od -An -tx1 | tr -d ' \n' >"$work/token")

# watch NAME OPTION...: a daemon that a viewer watches for two scans.
watch() {
  local name=$1
  shift
  : >"$work/output"
  "$program" run "$@" --log "$work/$name" --socket "$work/socket" --set server.listen=127.0.0.1:0 \
    --set server.token_file="$work/token" --set foxglove.enabled=true --set foxglove.map=true 2>"$work/output" >/dev/null &
  daemon=$!
  for _ in $(seq 100); do
    if grep -q 'http://' "$work/output"; then break; fi
    sleep 0.1
  done
  local address
  address=$(sed -n 's|.*http://\([0-9.:]*\).*|\1|p' "$work/output" | head -n 1)
  timeout 120 node "$foxglove_tools/foxglove.mjs" "$name" "$address" "$work/token" "$work/$name" "$program" || { cat "$work/output" >&2; exit 1; }
  kill "$daemon"
  wait "$daemon" || true
  daemon=
}
watch stepper --mock --scene simple-room --pose fig9 --set plan.to_deg=54 --set model.max_range_m=3
watch array --simulate --array pioneer-8 --scene mcgill-lab --pose fig4 --set scanning.mode=on-request
