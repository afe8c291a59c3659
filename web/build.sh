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
# Limits of the compressed sizes, bytes: of the playground, and of what the page "Hidden room" loads in addition.
max_bytes=1000000
max_survey_bytes=1000000

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
  module clippy --workspace -- -D warnings
fi
# One after the other, so that neither module has features of dependencies that only the other needs.
module build -p sonard-playground
module build -p sonard-playground-survey
wasm=$target/wasm/wasm32-unknown-unknown/release

rm -rf "$page"
mkdir -p "$page"
bundle() { "$tools/esbuild" "$1" --bundle --minify --format=iife --charset=utf8 --log-level=warning --outfile="$2"; }
bundle web/playground/main.js "$page/playground.js"
bundle web/playground/hidden-room.js "$page/hidden-room.js"
bundle web/playground/worker.js "$target/playground-worker.js"
bundle web/playground/survey-worker.js "$target/survey-worker.js"
# A page opened from disk can neither fetch a module nor start a worker from a file, so a script contains both.
pack() { node web/pack.mjs "$1" "$wasm/$2" "$target/$3" "$tools/.." "${@:4}"; }
pack SONARD_MODEL sonard_playground.wasm playground-worker.js >"$page/model-data.js"
pack SONARD_SURVEY sonard_playground_survey.wasm survey-worker.js page.is_survey_over page.report_progress >"$page/survey-data.js"
cp web/playground/{index.html,hidden-room.html,playground.css} crates/sonard-daemon/src/server/page/{style.css,icon.svg} "$page"

web/check-size.sh $max_bytes "$page"/{index.html,playground.js,model-data.js,playground.css,style.css,icon.svg}
web/check-size.sh $max_survey_bytes "$page"/{hidden-room.html,hidden-room.js,survey-data.js}
