#!/bin/bash
# Runs in a throw-away Debian (packaging/test.sh): a package's whole life.
set -euo pipefail
step() { printf -- '-- %s\n' "$*"; }
fail() { printf 'packaging/lifecycle.sh: %s\n' "$*" >&2; exit 1; }
export DEBIAN_FRONTEND=noninteractive
here=/etc/sonard/sonard.toml
enabled() { find /etc/systemd/system -name 'sonard*' | grep -q .; }

step "install"
dpkg --install /tmp/old.deb >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
sonard --version
getent passwd sonard >/dev/null || fail "there is no user sonard"
id -nG sonard | grep -qw dialout || fail "the user sonard may not use serial ports"
! enabled || fail "installing has enabled a unit"
for unit in sonard.service sonard@front.service sonard.socket; do
  said=$(systemd-analyze verify --man=no "$unit" 2>&1 | grep -F sonard || true)
  [ -z "$said" ] || fail "$unit: $said"
done
# As it is shipped it lacks a port, and says so; with a port it is right.
if sonard run --check >/tmp/said 2>&1; then fail "a daemon without a port is right"; fi
grep -q device.port /tmp/said || fail "$(cat /tmp/said)"
sonard run --check --port /dev/sonard >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
sonard simulate --scene simple-room --pose fig9 --step-deg 9 >/tmp/scan.jsonl 2>/tmp/said || fail "$(cat /tmp/said)"
sonard log verify /tmp/scan.jsonl >/tmp/said 2>&1 || fail "$(cat /tmp/said)"

step "upgrade with an edited configuration"
sed -i 's/^# port = .*/port = "\/dev\/sonard"/' $here
systemctl enable sonard.service >/dev/null 2>&1
dpkg --install --force-confdef --force-confold /tmp/new.deb >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
grep -qx 'port = "/dev/sonard"' $here || fail "the upgrade has changed an edited configuration"
grep -q '^# Configuration of' $here.dpkg-dist || fail "the new configuration is nowhere"
enabled || fail "the upgrade has disabled the daemon"
sonard run --check >/tmp/said 2>&1 || fail "$(cat /tmp/said)"

step "remove"
mkdir -p /var/lib/sonard
echo '{}' >/var/lib/sonard/sonard-20261121T000000Z.jsonl
dpkg --remove sonard >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
grep -qx 'port = "/dev/sonard"' $here || fail "removing took the configuration away"
[ ! -e /usr/bin/sonard ] || fail "the program is still there"

step "install anew, and purge"
dpkg --install --force-confdef --force-confold /tmp/new.deb >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
grep -qx 'port = "/dev/sonard"' $here || fail "the configuration was not taken up again"
dpkg --purge sonard >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
[ ! -e /etc/sonard ] || fail "purging left $(ls -A /etc/sonard) in /etc/sonard"
! enabled || fail "purging left a unit enabled"
[ -s /var/lib/sonard/sonard-20261121T000000Z.jsonl ] || fail "purging removed measured data"
grep -q 'are kept' /tmp/said || fail "purging does not say that it kept data"
rm -r /var/lib/sonard
dpkg --install /tmp/new.deb >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
mkdir -p /var/lib/sonard
dpkg --purge sonard >/tmp/said 2>&1 || fail "$(cat /tmp/said)"
[ ! -e /var/lib/sonard ] || fail "purging left an empty folder"
