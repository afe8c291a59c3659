#!/usr/bin/env bash
# Requests everything in the OpenAPI document from a daemon on a mock, in ways that the document
# allows and in others, and holds the answers against the document (Schemathesis, from PyPI, in an
# environment of its own under target/tools). Live streams are left out: they have no end.
#
#   tests/schemathesis.sh [PROGRAM]    without a program, it is built
set -euo pipefail
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
tools=$target/tools/schemathesis
tests/venv.sh "$tools" SCHEMATHESIS=0 schemathesis==4.32.5
program=${1:-$target/debug/sonard}
if [ $# = 0 ]; then cargo build --quiet; fi

work=$(mktemp -d)
daemon=
trap 'if [ -n "$daemon" ]; then kill "$daemon" && wait "$daemon" || true; fi; rm -rf "$work"' EXIT
token=0123456789abcdef0123456789abcdef
(umask 077 && echo "$token" >"$work/token")
"$program" run --mock --scene simple-room --pose fig9 --log "$work/log" --socket "$work/s" \
  --set server.listen=127.0.0.1:0 --set server.token_file="$work/token" \
  --set server.max_requests_per_s=100000 --set model.max_range_m=2 2>"$work/output" &
daemon=$!
address=
for _ in $(seq 100); do
  address=$(sed -n 's|.*listening on http://\([^ ]*\).*|\1|p' "$work/output")
  if [ -n "$address" ]; then break; fi
  sleep 0.1
done
# A scan is available to requests.
curl -sf --unix-socket "$work/s" -H 'Content-Type: application/json' -d '{"scans": 1}' \
  http://localhost/v1/start >/dev/null

"$tools/bin/schemathesis" --config-file tests/schemathesis.toml run "http://$address/v1/openapi.json" \
  --header "Authorization: Bearer $token" --exclude-path-regex '^/v1/live/' --checks all \
  --phases examples,coverage,fuzzing --max-examples "${SCHEMATHESIS_EXAMPLES:-50}" --seed 1 \
  --continue-on-failure --suppress-health-check all --warnings off --generation-database none
kill -0 "$daemon"
