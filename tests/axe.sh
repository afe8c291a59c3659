#!/usr/bin/env bash
# Gets axe-core, which looks at the live page for what keeps people out, into target/tools. It is
# under the MPL 2.0 and no part of this repository.
set -euo pipefail
cd "$(dirname "$0")/.."
version=4.14.1
tools=${CARGO_TARGET_DIR:-target}/tools
if [ ! -f "$tools/axe-core/axe.min.js" ]; then
  command -v npm >/dev/null || tests/install.sh "leave axe-core out with AXE=0" npm
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  (cd "$work" && npm pack --silent "axe-core@$version" >/dev/null && tar xzf "axe-core-$version.tgz")
  mkdir -p "$tools/axe-core"
  cp "$work/package/axe.min.js" "$work/package/LICENSE" "$tools/axe-core/"
fi
