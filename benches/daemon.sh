#!/usr/bin/env bash
# What `sonard run` costs, measured from outside on the whole process: CPU and memory while it idles
# and while it scans a mock in real time, and its own time until the first reading.
#
#   benches/daemon.sh [SECONDS]     so long for each (default 30)
#   SONARD=target/debug/sonard benches/daemon.sh     another program than the release build
#
# The mock is a process of its own, so its cost is not the daemon's. Figures of a busy computer are
# too high: CPU time grows with every cache that others emptied.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-30}
command -v curl >/dev/null || { echo "daemon.sh: curl is missing: apt-get install curl" >&2; exit 1; }
sonard=${SONARD:-}
if [ -z "$sonard" ]; then
  cargo build --release --quiet
  sonard=target/release/sonard
fi

work=$(mktemp -d)
mock= daemon=
cleanup() {
  # Each may have ended by itself.
  for process in $daemon $mock; do kill "$process" 2>/dev/null || true; done
  wait 2>/dev/null || true
  rm -rf "$work"
}
trap cleanup EXIT

ticks=$(getconf CLK_TCK)
cpu() { sed 's/.*) //' "/proc/$1/stat" | awk -v ticks="$ticks" '{print ($12 + $13) / ticks}'; }
memory() { awk -v key="$2:" '$1 == key {print $2}' "/proc/$1/status"; }
ask() { curl -s --unix-socket "$work/s" "http://localhost$1" "${@:2}"; }
share() { # CPU of the daemon over the measured time, percent of a core
  local before after
  before=$(cpu "$daemon"); sleep "$seconds"; after=$(cpu "$daemon")
  awk -v a="$before" -v b="$after" -v s="$seconds" 'BEGIN {printf "%.2f", 100 * (b - a) / s}'
}
wait_for() { # a text in the answer to a path
  for _ in $(seq 600); do
    if ask "$2" 2>/dev/null | grep -q "$1"; then return; fi
    sleep 0.05
  done
  echo "daemon.sh: waited in vain for $1" >&2; exit 1
}

"$sonard" mock --scene simple-room --pose fig9 --realtime --link "$work/ranger" >/dev/null &
mock=$!
for _ in $(seq 200); do [ -e "$work/ranger" ] && break; sleep 0.05; done
SONARD_LOG=error "$sonard" run --port "$work/ranger" --scene simple-room --pose fig9 --log "$work/log" \
  --socket "$work/s" &
daemon=$!
wait_for '"state":"ready"' /v1/status
started=$(cpu "$daemon")
idle=$(share)
ask /v1/start --json '{"scans": 1000}' >/dev/null
wait_for '"done":[1-9]' /v1/status
first=$(cpu "$daemon")
scanning=$(share)
printf 'idle        %6s %% of a core\n' "$idle"
printf 'scanning    %6s %% of a core (400 beams a scan, 10 m, 3 echoes, predictions beside)\n' "$scanning"
printf 'resident    %6s kB, at most %s kB\n' "$(memory "$daemon" VmRSS)" "$(memory "$daemon" VmHWM)"
printf 'own time    %6s s until it was ready, %s s until the first reading (idle time included)\n' \
  "$started" "$first"
