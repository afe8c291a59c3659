#!/usr/bin/env bash
# Builds the playground as a static folder, target/playground/, which also opens from disk.
#
#   web/build.sh            check types and lints, build, and enforce the size limit
#   CHECK=0 web/build.sh    build only
set -euo pipefail
cd "$(dirname "$0")/.."
target=$PWD/${CARGO_TARGET_DIR:-target}
case ${CARGO_TARGET_DIR:-} in /*) target=$CARGO_TARGET_DIR ;; esac
page=$target/playground
# Limit of the compressed size of all files, bytes.
max_bytes=1000000

if command -v rustup >/dev/null; then
  rustup --quiet target add wasm32-unknown-unknown || {
    echo "web/build.sh: the target wasm32-unknown-unknown is not available; skip the playground with PLAYGROUND=0" >&2
    exit 1
  }
fi
web/tools.sh
tools=$target/tools/web/node_modules/.bin
# web/wasm is a workspace of its own, so it has its own target folder.
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
# A page opened from disk can neither fetch a module nor start a worker from a file, so a script contains both.
node web/pack.mjs "$wasm" "$target/playground-worker.js" "$tools/.." >"$page/model-data.js"
cp web/playground/{index.html,playground.css} crates/sonard-daemon/src/server/page/{style.css,icon.svg} "$page"

bytes=0
for file in "$page"/*; do
  size=$(gzip -9 -c "$file" | wc -c)
  bytes=$((bytes + size))
  printf '%8d  %s\n' "$size" "$(basename "$file")"
done
printf '%8d  total, compressed, bytes\n' "$bytes"
[ "$bytes" -lt "$max_bytes" ] || { echo "web/build.sh: the total exceeds $max_bytes bytes" >&2; exit 1; }
