#!/usr/bin/env bash
# The units are right, and a daemon that were taken over could do little: `systemd-analyze verify`
# and `security` with a threshold of 2.0, which needs no running systemd.
set -euo pipefail
cd "$(dirname "$0")"
fail() { printf 'systemd/test.sh: %s\n' "$*" >&2; exit 1; }

command -v systemd-analyze >/dev/null || ../tests/install.sh "" systemd

# Verifying wants the program where the unit says it is.
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
for unit in sonard.service sonard@.service sonard.socket; do
  sed "s|/usr/bin/sonard|/bin/true|" "$unit" >"$root/$unit"
done
cp "$root/sonard@.service" "$root/sonard@front.service"
for unit in sonard.service sonard@front.service sonard.socket; do
  said=$(SYSTEMD_UNIT_PATH="$root:" systemd-analyze verify --man=no "$root/$unit" 2>&1 | grep -F sonard || true)
  [ -z "$said" ] || fail "$unit: $said"
done
for unit in sonard.service sonard@front.service; do
  systemd-analyze security --offline=yes --threshold=20 --no-pager "$root/$unit" >"$root/said" ||
    { cat "$root/said" >&2; fail "$unit is exposed by more than 2.0"; }
  printf '%s: %s\n' "$unit" "$(tail -n 1 "$root/said" | sed 's/^.*Overall/overall/')"
done

# The instance differs from the single unit only where it has to.
differ=$(diff sonard.service sonard@.service | grep -c '^[<>]') || true
[ "$differ" -le 18 ] || fail "sonard.service and sonard@.service have drifted apart: $differ lines"

if command -v systemd-sysusers >/dev/null; then
  mkdir -p "$root/fs/etc"
  printf 'g dialout 20\n' | cat - sonard.sysusers >"$root/sysusers.conf"
  systemd-sysusers --root="$root/fs" "$root/sysusers.conf" >/dev/null 2>"$root/said" || fail "$(cat "$root/said")"
  grep -q '^sonard:' "$root/fs/etc/passwd" || fail "sysusers made no user"
fi
if command -v udevadm >/dev/null && udevadm verify --help >/dev/null 2>&1; then
  udevadm verify --no-style 60-sonard.rules >/dev/null 2>"$root/said" || fail "$(cat "$root/said")"
fi
printf 'units, users and rule are right\n'
