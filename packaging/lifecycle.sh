#!/bin/bash
# Runs in a throw-away Debian (packaging/test.sh): a package's whole life.
set -euo pipefail
step() { printf -- '-- %s\n' "$*"; }
fail() { printf 'packaging/lifecycle.sh: %s\n' "$*" >&2; exit 1; }
export DEBIAN_FRONTEND=noninteractive
here=/etc/sonard/sonard.toml
enabled() { find /etc/systemd/system -name 'sonard*' | grep -q .; }

step "install"
dpkg --install /tmp/old.deb >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
sonard --version
getent passwd sonard >/dev/null || fail "there is no user sonard"
id -nG sonard | grep -qw dialout || fail "the user sonard may not use serial ports"
! enabled || fail "installing has enabled a unit"
for unit in sonard.service sonard@front.service sonard.socket; do
  printed=$(systemd-analyze verify --man=no "$unit" 2>&1 | grep -F sonard || true)
  [ -z "$printed" ] || fail "$unit: $printed"
done
# As shipped it has no port, which is an error; with a port it is right.
if sonard run --check >/tmp/output 2>&1; then fail "a daemon without a port is right"; fi
grep -q device.port /tmp/output || fail "$(cat /tmp/output)"
sonard run --check --port /dev/sonard >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
sonard simulate --scene simple-room --pose fig9 --step-deg 9 >/tmp/scan.jsonl 2>/tmp/output || fail "$(cat /tmp/output)"
sonard log verify /tmp/scan.jsonl >/tmp/output 2>&1 || fail "$(cat /tmp/output)"

step "upgrade with an edited configuration"
sed -i 's/^# port = .*/port = "\/dev\/sonard"/' $here
systemctl enable sonard.service >/dev/null 2>&1
dpkg --install --force-confdef --force-confold /tmp/new.deb >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
grep -qx 'port = "/dev/sonard"' $here || fail "the upgrade has changed an edited configuration"
grep -q '^# Configuration of' $here.dpkg-dist || fail "the new configuration is nowhere"
enabled || fail "the upgrade has disabled the daemon"
sonard run --check >/tmp/output 2>&1 || fail "$(cat /tmp/output)"

step "remove"
mkdir -p /var/lib/sonard
echo '{}' >/var/lib/sonard/sonard-20261121T000000Z.jsonl
dpkg --remove sonard >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
grep -qx 'port = "/dev/sonard"' $here || fail "removing took the configuration away"
[ ! -e /usr/bin/sonard ] || fail "the program is still there"

step "install again, and purge"
dpkg --install --force-confdef --force-confold /tmp/new.deb >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
grep -qx 'port = "/dev/sonard"' $here || fail "the configuration was not taken up again"
dpkg --purge sonard >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
[ ! -e /etc/sonard ] || fail "purging left $(ls -A /etc/sonard) in /etc/sonard"
! enabled || fail "purging left a unit enabled"
[ -s /var/lib/sonard/sonard-20261121T000000Z.jsonl ] || fail "purging removed measured data"
grep -q 'are kept' /tmp/output || fail "purging does not report the data that it kept"
rm -r /var/lib/sonard
dpkg --install /tmp/new.deb >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
mkdir -p /var/lib/sonard
dpkg --purge sonard >/tmp/output 2>&1 || fail "$(cat /tmp/output)"
[ ! -e /var/lib/sonard ] || fail "purging left an empty folder"
