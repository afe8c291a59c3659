#!/usr/bin/env bash
# What `sonard run` costs, measured from outside on the whole process: CPU and memory while it idles
# and while it scans a mock in real time, and its own time until the first reading.
#
#   benches/daemon.sh [SECONDS]     so long for each (default 30)
#   SONARD=target/debug/sonard benches/daemon.sh     another program than the release build
#
# Figures of a busy computer are too high: CPU time grows with every cache that others emptied.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-30}
command -v curl >/dev/null || { echo "daemon.sh: curl is missing: apt-get install curl" >&2; exit 1; }
sonard=${SONARD:-}
if [ -z "$sonard" ]; then
  cargo build --release --quiet
  sonard=target/release/sonard
fi

. benches/measure.sh
start_daemon
started=$(cpu "$daemon")
idle=$(share)
start_scanning
first=$(cpu "$daemon")
scanning=$(share)
printf 'idle        %6s %% of a core\n' "$idle"
printf 'scanning    %6s %% of a core (400 beams a scan, 10 m, 3 echoes, predictions beside)\n' "$scanning"
printf 'resident    %6s kB, at most %s kB\n' "$(memory "$daemon" VmRSS)" "$(memory "$daemon" VmHWM)"
printf 'own time    %6s s until it was ready, %s s until the first reading (idle time included)\n' \
  "$started" "$first"
