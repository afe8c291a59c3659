#!/usr/bin/env bash
# The units are right, and a daemon that were taken over could do little: `systemd-analyze verify`
# and `security` with a threshold of 2.0, which needs no running systemd.
set -euo pipefail
cd "$(dirname "$0")"
fail() { printf 'systemd/test.sh: %s\n' "$*" >&2; exit 1; }

command -v systemd-analyze >/dev/null || ../tests/install.sh "" systemd

# Verification needs the program at the path in the unit.
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
for unit in sonard.service sonard@.service sonard.socket; do
  sed "s|/usr/bin/sonard|/bin/true|" "$unit" >"$root/$unit"
done
cp "$root/sonard@.service" "$root/sonard@front.service"
for unit in sonard.service sonard@front.service sonard.socket; do
  printed=$(SYSTEMD_UNIT_PATH="$root:" systemd-analyze verify --man=no "$root/$unit" 2>&1 | grep -F sonard || true)
  [ -z "$printed" ] || fail "$unit: $printed"
done
for unit in sonard.service sonard@front.service; do
  systemd-analyze security --offline=yes --threshold=20 --no-pager "$root/$unit" >"$root/output" ||
    { cat "$root/output" >&2; fail "$unit is exposed by more than 2.0"; }
  printf '%s: %s\n' "$unit" "$(tail -n 1 "$root/output" | sed 's/^.*Overall/overall/')"
done

for unit in sonard.service sonard@.service; do
  # Without a network that target may never be reached, and the daemon would never start.
  grep -q '^[A-Z][a-z]*=.*time-sync.target' "$unit" && fail "$unit waits for time-sync.target"
  # The modules that register the drivers which the device policy names; others are built in.
  for driver in ttyACM:cdc_acm ttyUSB:usbserial; do
    grep -q "^DeviceAllow=char-${driver%:*} " "$unit" || fail "$unit does not allow ${driver%:*}"
    for key in Wants After; do
      grep -q "^$key=.*modprobe@${driver#*:}.service" "$unit" || fail "$unit: ${driver#*:} may be loaded too late"
    done
  done
  # A scan's prediction, a client's preview, all clients, and the rest.
  bound=$(sed -n 's/.*bytes: \([0-9_]*\) .*/\1/p' ../crates/sonard-model/src/model/paths/effort.rs | head -n 1 | tr -d _)
  limit=$(sed -n 's/^MemoryMax=\([0-9]*\)M$/\1/p' "$unit")
  [ $((limit << 20)) -ge $((2 * bound + 64000000 + 50000000)) ] || fail "$unit: MemoryMax=${limit}M, the model may take $bound bytes twice"
done

# The instance differs from the single unit only where it has to.
differ=$(diff sonard.service sonard@.service | grep -c '^[<>]') || true
[ "$differ" -le 18 ] || fail "sonard.service and sonard@.service have drifted apart: $differ lines"

if command -v systemd-sysusers >/dev/null; then
  mkdir -p "$root/fs/etc"
  printf 'g dialout 20\n' | cat - sonard.sysusers >"$root/sysusers.conf"
  systemd-sysusers --root="$root/fs" "$root/sysusers.conf" >/dev/null 2>"$root/output" || fail "$(cat "$root/output")"
  grep -q '^sonard:' "$root/fs/etc/passwd" || fail "sysusers made no user"
fi
if command -v udevadm >/dev/null && udevadm verify --help >/dev/null 2>&1; then
  udevadm verify --no-style 60-sonard.rules >/dev/null 2>"$root/output" || fail "$(cat "$root/output")"
fi
printf 'units, users and rule are right\n'
