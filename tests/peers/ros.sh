#!/usr/bin/env bash
# Receives a daemon's messages to ROS 2 with Cyclone DDS, in a network of its own that has loopback and an interface without
# peers, and compares every field with the daemon's log (ros.py).
#
#   tests/peers/ros.sh [PROGRAM]    with the feature ros; without a program, it is built
set -euo pipefail
cd "$(dirname "$0")/../.."
. tests/peers/ros-tools.sh
program=$(realpath "${1:-${CARGO_TARGET_DIR:-target}/debug/sonard}")
if [ $# = 0 ]; then cargo build --quiet --features full; fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tests/peers/ros-network.sh "$work" timeout 600 "$ros_tools/bin/python" tests/peers/ros.py "$program" "$work"
