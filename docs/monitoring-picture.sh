#!/usr/bin/env bash
# Draws what Prometheus shows of a daemon: the room is 8 degrees colder than configured, and after two minutes the temperature is
# corrected. Takes four minutes.
#
#   docs/monitoring-picture.sh SONARD PICTURE
set -euo pipefail
sonard=$(realpath "$1") picture=$(realpath "$2")
work=$(mktemp -d)
jobs=()
trap 'kill "${jobs[@]}" 2>/dev/null || true; wait; rm -rf "$work"' EXIT
cd "$work"

"$sonard" run --mock --realtime --scene simple-room --pose fig9 --truth-temperature-c 12 --noise-mm 1 --log log \
  --socket s.sock --set server.listen=127.0.0.1:8765 --set scanning.mode=continuous --set plan.step_deg=3.6 \
  --set model.max_range_m=4 2>daemon.log &
jobs+=($!)
cat >prometheus.yml <<'YAML'
scrape_configs:
  - job_name: sonard
    scrape_interval: 2s
    static_configs: [{targets: ["127.0.0.1:8765"]}]
YAML
prometheus --config.file=prometheus.yml --storage.tsdb.path=data --web.listen-address=127.0.0.1:9090 2>prometheus.log &
jobs+=($!)
sleep 135
curl -sf --unix-socket s.sock -X PUT -H 'content-type: application/json' -d '{"temperature_c":12}' \
  http://localhost/v1/air >/dev/null
sleep 75
chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size=1000,800 --virtual-time-budget=8000 \
  --screenshot="$picture" \
  "http://127.0.0.1:9090/graph?g0.expr=sonard_last_scan_residual_median_meters&g0.tab=0&g0.range_input=4m" 2>/dev/null
