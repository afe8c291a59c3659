#!/usr/bin/env bash
# Smoke test of the live page: Chromium loads it from a daemon on a mock, and the page shows the link and a finished scan.
# tests/browser tests the page in detail.
#
#   tests/page.sh PROGRAM
set -euo pipefail
program=$1
work=$(mktemp -d)
daemon=
trap 'if [ -n "$daemon" ]; then kill "$daemon" && wait "$daemon" || true; fi; rm -rf "$work"' EXIT
fail() { printf 'tests/page.sh: %s\n' "$*" >&2; exit 1; }

"$program" run --mock --virtual-time --scene simple-room --pose fig9 --log "$work/log" --socket "$work/s" \
  --set server.listen=127.0.0.1:0 --set model.max_range_m=3 2>"$work/messages" &
daemon=$!
address=
for _ in $(seq 200); do
  address=$(sed -n 's|.*listening on http://\([^ ]*\).*|\1|p' "$work/messages")
  if [ -n "$address" ]; then break; fi
  sleep 0.1
done
[ -n "$address" ] || fail "the daemon does not listen: $(cat "$work/messages")"
curl -sf --retry 20 --retry-all-errors --retry-delay 1 --unix-socket "$work/s" -H 'Content-Type: application/json' \
  -d '{"scans": 1}' http://localhost/v1/start >/dev/null
for _ in $(seq 200); do
  if curl -sf --unix-socket "$work/s" http://localhost/v1/scan/latest | grep -q '"end":{'; then break; fi
  sleep 0.1
done
timeout 60 chromium --headless --no-sandbox --disable-gpu --user-data-dir="$work/profile" --virtual-time-budget=5000 --dump-dom \
  "http://$address/" >"$work/page" 2>"$work/chromium" || fail "chromium: $(tail -n 5 "$work/chromium")"
grep -q 'id="link"[^>]*>ready<' "$work/page" || fail "the page does not show the link: $(grep -o 'id="link"[^<]*<' "$work/page")"
grep -Eq 'id="scan-label"[^>]*>[^<]*400 of 400' "$work/page" ||
  fail "the page does not show the scan: $(grep -o 'id="scan-label"[^<]*<' "$work/page")"
printf 'the page shows link and scan\n'
