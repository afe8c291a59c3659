#!/usr/bin/env bash
# Has mosquitto take what a daemon sends it, while both are killed, and holds what its own subscriber got against the
# daemon's log (mqtt.py).
#
#   tests/peers/mqtt.sh [PROGRAM]    without a program, it is built
set -euo pipefail
cd "$(dirname "$0")/../.."
target=${CARGO_TARGET_DIR:-target}
for tool in mosquitto mosquitto_sub mosquitto_pub mosquitto_passwd openssl python3; do
  # Debian puts brokers where only root looks.
  PATH=$PATH:/usr/sbin command -v "$tool" >/dev/null || {
    tests/install.sh "leave the broker out with MQTT_PEER=0" mosquitto mosquitto-clients openssl python3
    break
  }
done
program=$(realpath "${1:-$target/debug/sonard}")
if [ $# = 0 ]; then cargo build --quiet --features full; fi
PATH=$PATH:/usr/sbin timeout 600 python3 tests/peers/mqtt.py "$program"
