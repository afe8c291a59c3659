#!/usr/bin/env bash
# Round trips through foreign formats (imports.py) and floor plans as the formats' own tools read them (floor_plans.py; tools from
# PyPI, in an environment of their own under target/tools). Each prints a table.
#
#   tests/peers/imports.sh [PROGRAM]    without a program, it is built
set -euo pipefail
cd "$(dirname "$0")/../.."
packages=(ezdxf==1.4.5 numpy==2.4.6 rosbags==0.11.9 shapely==2.2.0 svgelements==1.9.6)
target=${CARGO_TARGET_DIR:-target}
tools=$target/tools/imports
tests/venv.sh "$tools" IMPORT_PEERS=0 "${packages[@]}"
program=$(realpath "${1:-$target/debug/sonard}")
if [ $# = 0 ]; then cargo build --quiet --features full; fi
"$tools/bin/python" tests/peers/imports.py "$program"
"$tools/bin/python" tests/peers/floor_plans.py "$program"
