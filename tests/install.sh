#!/usr/bin/env bash
# Installs Debian's packages where that may be done, else prints what to do.
#
#   tests/install.sh WITHOUT PACKAGE...   WITHOUT is how to do without them ("leave the page out with PAGE=0"), or is empty
set -euo pipefail
without=$1
shift
if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
  # One at a time, because steps of test.sh run beside each other; what a package starts does not keep the lock.
  flock --close "$0" sh -c 'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@" >/dev/null' sh "$@"
else
  echo "missing here: sudo apt-get install --no-install-recommends $*${without:+, or $without}" >&2
  exit 1
fi
