#!/usr/bin/env bash
# Cost of a daemon with all outputs, each with a subscriber of everything: the page's event stream, a viewer of
# Foxglove's protocol, ROS 2 and an MQTT broker; maps with both. CPU and memory of the daemon alone, while it idles and while it
# scans a mock in real time.
#
#   benches/outputs.sh [SECONDS]     so long for each (default 60)
#   OUTPUTS="ros mqtt" benches/outputs.sh            some of page, foxglove, ros, mqtt; "" for none
#   SONARD=target/debug/sonard benches/outputs.sh    another program than the release build; with the features ros and mqtt
#
# It runs in a network of its own that has loopback alone. Subscribers are those of tests/peers. Figures of a busy computer are
# too high: CPU time grows with every cache that others emptied.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
read -ra outputs <<<"${OUTPUTS-page foxglove ros mqtt}"
if [ -z "${WITHIN:-}" ]; then
  for tool in curl mosquitto mosquitto_sub; do
    # Debian puts brokers where only root looks.
    PATH=$PATH:/usr/sbin command -v "$tool" >/dev/null || { tests/install.sh "" curl mosquitto mosquitto-clients; break; }
  done
  . tests/peers/ros-tools.sh
  . tests/peers/foxglove-tools.sh
  sonard=${SONARD:-}
  if [ -z "$sonard" ]; then
    cargo build --release --quiet --features mqtt,ros
    sonard=${CARGO_TARGET_DIR:-target}/release/sonard
  fi
  settings=$(mktemp -d)
  trap 'rm -rf "$settings"' EXIT
  export WITHIN=1 SONARD=$sonard PATH=$PATH:/usr/sbin ros_tools foxglove_tools
  tests/peers/ros-network.sh "$settings" benches/outputs.sh "$seconds"
  exit
fi

sonard=$SONARD
. benches/measure.sh
(umask 077 && head -c 16 /dev/urandom | od -An -tx1 | tr -d ' \n' >"$work/token")
options=(--set server.listen=127.0.0.1:8765 --set "server.token_file=$work/token")
has_output() { [[ " ${outputs[*]} " == *" $1 "* ]]; }
if has_output foxglove; then options+=(--set foxglove.enabled=true --set foxglove.map=true); fi
if has_output ros; then options+=(--set ros.enabled=true --set ros.map=true); fi
if has_output mqtt; then
  printf '%s\n' 'listener 1883 127.0.0.1' 'allow_anonymous true' 'user root' >"$work/broker.conf"
  mosquitto -c "$work/broker.conf" 2>/dev/null &
  others+=" $!"
  until (exec 3<>/dev/tcp/127.0.0.1/1883) 2>/dev/null; do sleep 0.05; done
  mosquitto_sub -h 127.0.0.1 -t 'sonard/#' -q 1 >"$work/by-mqtt" &
  others+=" $!"
  options+=(--set mqtt.broker=mqtt://127.0.0.1:1883)
fi
start_daemon "${options[@]}"
if has_output page; then
  request '/v1/live/records?format=sse&verdicts=true' -N >"$work/by-page" &
  others+=" $!"
fi
if has_output foxglove; then
  node "$foxglove_tools/foxglove.mjs" watch 127.0.0.1:8765 "$work/token" &
  others+=" $!"
fi
if has_output ros; then
  "$ros_tools/bin/python" tests/peers/ros.py "$sonard" "$work" subscribe &
  others+=" $!"
  wait_for '"subscriptions":1[0-9]' /v1/status
fi
if has_output mqtt; then wait_for '"connected":true' /v1/status; fi

idle=$(share)
start_scanning
scanning=$(share)
printf 'outputs     %s\n' "${outputs[*]:-none}"
printf 'idle        %6s %% of a core\n' "$idle"
printf 'scanning    %6s %% of a core (400 beams a scan, 10 m, 3 echoes, predictions beside)\n' "$scanning"
printf 'resident    %6s kB, at most %s kB\n' "$(memory "$daemon" VmRSS)" "$(memory "$daemon" VmHWM)"
figures=$(request /metrics)
count() { awk -v name="$1" '$1 == name {print $2}' <<<"$figures"; }
for name in sonard_ros_messages_total sonard_ros_dropped_messages_total sonard_mqtt_acknowledged_records_total; do
  value=$(count "$name")
  if [ -n "$value" ]; then printf '%-12s%s\n' "" "$name $value"; fi
done
