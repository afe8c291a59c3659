#!/usr/bin/env bash
# Installs esbuild and TypeScript from npm into target/tools, to bundle the playground and check its types.
set -euo pipefail
cd "$(dirname "$0")/.."
packages=(esbuild@0.25.11 typescript@5.9.3)
tools=${CARGO_TARGET_DIR:-target}/tools/web
if [ "$(cat "$tools/packages" 2>/dev/null)" != "${packages[*]}" ]; then
  command -v npm >/dev/null || tests/install.sh "leave the playground out with PLAYGROUND=0" npm
  mkdir -p "$tools"
  npm install --silent --no-fund --no-audit --no-save --prefix "$tools" "${packages[@]}"
  echo "${packages[*]}" >"$tools/packages"
fi
