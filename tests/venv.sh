#!/usr/bin/env bash
# Makes a virtual environment of Python with the packages named, or keeps the one that has them; installs Python's
# venv where that is missing and may be installed, else prints what to do.
#
#   tests/venv.sh FOLDER SWITCH PACKAGE...   SWITCH leaves out what it is for: PYTHON=0
#   INTERPRETER=python3.13 tests/venv.sh ...   another than python3; 3.10 or newer
set -euo pipefail
folder=$1 switch=$2
shift 2
interpreter=${INTERPRETER:-python3}
if [ "$(cat "$folder/packages" 2>/dev/null)" = "$*" ]; then exit; fi
if ! "$interpreter" -c 'import sys, ensurepip, venv; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
  if [ "$interpreter" = python3 ]; then
    "$(dirname "$0")/install.sh" "leave this out with $switch" python3 python3-venv
  else
    echo "$0: $interpreter 3.10 or newer with venv is missing: install it, or leave this out with $switch" >&2
    exit 1
  fi
fi
rm -rf "$folder"
"$interpreter" -m venv "$folder"
"$folder/bin/pip" install --quiet --disable-pip-version-check "$@"
# Last, so that an environment broken off is made again.
printf '%s' "$*" >"$folder/packages"
