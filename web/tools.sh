#!/usr/bin/env bash
# Gets what bundles the playground and checks its types (esbuild and TypeScript, from npm) into target/tools.
# Neither is part of this repository.
set -euo pipefail
cd "$(dirname "$0")/.."
packages=(esbuild@0.25.11 typescript@5.9.3)
tools=${CARGO_TARGET_DIR:-target}/tools/web
if [ "$(cat "$tools/packages" 2>/dev/null)" != "${packages[*]}" ]; then
  if ! command -v npm >/dev/null; then
    if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
      apt-get update -qq && apt-get install -y -qq --no-install-recommends npm >/dev/null
    else
      echo "web/tools.sh: npm is missing: sudo apt-get install npm, or leave the playground out with PLAYGROUND=0" >&2
      exit 1
    fi
  fi
  mkdir -p "$tools"
  npm install --silent --no-fund --no-audit --no-save --prefix "$tools" "${packages[@]}"
  echo "${packages[*]}" >"$tools/packages"
fi
