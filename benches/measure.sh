# Sourced by benches that measure a daemon from outside: a mock in real time in a process of its own, whose cost is not the daemon's,
# and the daemon's CPU time and memory. They set `sonard` (the program) and `seconds` (how long is measured).

work=$(mktemp -d)
mock= daemon= others=
cleanup() {
  # Each may have ended by itself.
  for process in $others $daemon $mock; do kill "$process" 2>/dev/null || true; done
  wait 2>/dev/null || true
  rm -rf "$work"
}
trap cleanup EXIT

ticks=$(getconf CLK_TCK)
cpu() { sed 's/.*) //' "/proc/$1/stat" | awk -v ticks="$ticks" '{print ($12 + $13) / ticks}'; }
memory() { awk -v key="$2:" '$1 == key {print $2}' "/proc/$1/status"; }
request() { curl -s --unix-socket "$work/s" "http://localhost$1" "${@:2}"; }
share() { # CPU of the daemon over the measured time, percent of a core
  local before after
  before=$(cpu "$daemon"); sleep "$seconds"; after=$(cpu "$daemon")
  awk -v a="$before" -v b="$after" -v s="$seconds" 'BEGIN {printf "%.2f", 100 * (b - a) / s}'
}
wait_for() { # a text in the answer to a path
  for _ in $(seq 600); do
    if request "$2" 2>/dev/null | grep -q "$1"; then return; fi
    sleep 0.05
  done
  echo "$0: waited in vain for $1" >&2; exit 1
}
start_daemon() { # with these options; in the simple room, scanning on request
  "$sonard" mock --scene simple-room --pose fig9 --realtime --link "$work/ranger" >/dev/null &
  mock=$!
  for _ in $(seq 200); do [ -e "$work/ranger" ] && break; sleep 0.05; done
  SONARD_LOG=error "$sonard" run --port "$work/ranger" --scene simple-room --pose fig9 --log "$work/log" \
    --socket "$work/s" "$@" &
  daemon=$!
  wait_for '"state":"ready"' /v1/status
}
start_scanning() {
  request /v1/start --json '{"scans": 1000}' >/dev/null
  wait_for '"done":[1-9]' /v1/status
}
