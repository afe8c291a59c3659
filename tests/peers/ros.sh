#!/usr/bin/env bash
# Has Cyclone DDS (from PyPI, under target/tools) take what a daemon tells ROS 2, in a network of its own that has loopback
# and an interface on which nobody is, and holds every field against the daemon's log (ros.py).
#
#   tests/peers/ros.sh [PROGRAM]    with the feature ros; without a program, it is built
set -euo pipefail
cd "$(dirname "$0")/../.."
packages=(cyclonedds==11.0.1 mcap==1.6.0 mcap-ros2-support==0.6.0)
target=${CARGO_TARGET_DIR:-target}
tools=$(realpath -m "$target/tools/ros")
tests/venv.sh "$tools" ROS_PEER=0 "${packages[@]}"
for needed in unshare ip; do
  command -v $needed >/dev/null || tests/install.sh "leave ROS 2 out with ROS_PEER=0" util-linux iproute2
done
program=$(realpath "${1:-$target/debug/sonard}")
if [ $# = 0 ]; then cargo build --workspace --quiet; fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat >"$work/cyclonedds.xml" <<'XML'
<CycloneDDS><Domain><General><Interfaces>
  <NetworkInterface name="lo" multicast="true"/>
</Interfaces></General></Domain></CycloneDDS>
XML
network='set -e
ip link set lo up multicast on
ip route add 224.0.0.0/4 dev lo
ip link add outside type veth peer name beyond
sysctl -qw net.ipv6.conf.all.disable_ipv6=1 2>/dev/null || true
ip address add 10.77.0.1/24 dev outside
ip link set beyond up
ip link set outside up
exec "$@"'
# As root of this network alone, where one is not root.
rights=()
[ "$(id -u)" = 0 ] || rights=(--user --map-root-user)
CYCLONEDDS_URI="file://$work/cyclonedds.xml" unshare "${rights[@]}" --net --fork --kill-child bash -c "$network" network \
  timeout 600 "$tools/bin/python" tests/peers/ros.py "$program" "$work"
