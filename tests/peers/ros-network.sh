#!/usr/bin/env bash
# Runs a command in a network of its own, that has loopback with multicast and an interface without peers; Cyclone DDS
# within it speaks by loopback.
#
#   tests/peers/ros-network.sh FOLDER COMMAND...     FOLDER is for a file of settings
set -euo pipefail
folder=$1
shift
cat >"$folder/cyclonedds.xml" <<'XML'
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
CYCLONEDDS_URI="file://$folder/cyclonedds.xml" exec unshare "${rights[@]}" --net --fork --kill-child \
  bash -c "$network" network "$@"
