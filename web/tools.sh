#!/usr/bin/env bash
# Installs esbuild, TypeScript and zopfli from npm into target/tools, to bundle the playground, check its types and
# compress its module.
set -euo pipefail
cd "$(dirname "$0")/.."
packages=(esbuild@0.25.11 typescript@5.9.3 @gfx/zopfli@1.0.15)
tools=${CARGO_TARGET_DIR:-target}/tools/web
if [ "$(cat "$tools/packages" 2>/dev/null)" != "${packages[*]}" ]; then
  command -v npm >/dev/null || tests/install.sh "leave the playground out with PLAYGROUND=0" npm
  mkdir -p "$tools"
  npm install --silent --no-fund --no-audit --no-save --prefix "$tools" "${packages[@]}"
  echo "${packages[*]}" >"$tools/packages"
fi
