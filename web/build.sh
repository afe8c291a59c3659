#!/usr/bin/env bash
# Builds the playground, a folder that any web server or none can serve: target/playground/index.html.
#
#   web/build.sh            check types and lints, build, and hold its size
#   CHECK=0 web/build.sh    build alone
set -euo pipefail
cd "$(dirname "$0")/.."
target=$PWD/${CARGO_TARGET_DIR:-target}
case ${CARGO_TARGET_DIR:-} in /*) target=$CARGO_TARGET_DIR ;; esac
page=$target/playground
# All that the page loads, compressed, bytes.
most=1000000

if command -v rustup >/dev/null; then
  rustup --quiet target add wasm32-unknown-unknown || {
    echo "web/build.sh: the target wasm32-unknown-unknown can't be had; leave the playground out with PLAYGROUND=0" >&2
    exit 1
  }
fi
web/tools.sh
tools=$target/tools/web/node_modules/.bin
# A workspace of its own: what is built here is of no use to the other one.
module() { (cd web/wasm && CARGO_TARGET_DIR=$target/wasm cargo "$1" --release --locked --quiet "${@:2}"); }
if [ "${CHECK:-1}" != 0 ]; then
  "$tools/tsc" --project web/jsconfig.json
  module clippy -- -D warnings
fi
module build
wasm=$target/wasm/wasm32-unknown-unknown/release/sonard_playground.wasm

rm -rf "$page"
mkdir -p "$page"
bundle() { "$tools/esbuild" "$1" --bundle --minify --format=iife --charset=utf8 --log-level=warning --outfile="$2"; }
bundle web/playground/main.js "$page/playground.js"
bundle web/playground/worker.js "$target/playground-worker.js"
# From a folder a page can neither fetch a module nor start a worker's file: both come in a script.
node web/pack.mjs "$wasm" "$target/playground-worker.js" >"$page/model-data.js"
cp web/playground/{index.html,playground.css} crates/sonard-daemon/src/server/page/{style.css,icon.svg} "$page"

bytes=0
for file in "$page"/*; do
  size=$(gzip -9 -c "$file" | wc -c)
  bytes=$((bytes + size))
  printf '%8d  %s\n' "$size" "$(basename "$file")"
done
printf '%8d  all that the playground loads, compressed, bytes\n' "$bytes"
[ "$bytes" -lt "$most" ] || { echo "web/build.sh: that is more than $most" >&2; exit 1; }
