#!/usr/bin/env bash
# Builds the Debian package and does with it what people do: looks into it, installs it, edits its
# configuration, upgrades, removes and purges it, in a Debian of its own that is thrown away.
#
#   packaging/test.sh         for this computer
#   packaging/test.sh dev     for this computer, around the program that the tests use, which takes no build
#   packaging/test.sh arm64   for a Raspberry Pi: cross-built, looked into, run in an emulator
#   packaging/test.sh tools   no test, but what these need
set -euo pipefail
cd "$(dirname "$0")/.."
. packaging/debian.sh
step() { printf -- '-- %s\n' "$*"; }
fail() { printf 'packaging/test.sh: %s\n' "$*" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# What is the same on every architecture.
look_into() {
  local deb=$1 architecture=$2
  [ "$(dpkg-deb --field "$deb" Package Architecture)" = "$(printf 'Package: sonard\nArchitecture: %s' "$architecture")" ] ||
    fail "the package is not sonard for $architecture: $(dpkg-deb --info "$deb")"
  dpkg-deb --contents "$deb" | awk '{print $6}' >"$work/contents"
  for file in usr/bin/sonard etc/sonard/sonard.toml usr/lib/udev/rules.d/60-sonard.rules \
    usr/lib/sysusers.d/sonard.conf usr/lib/tmpfiles.d/sonard.conf usr/share/man/man1/sonard-run.1.gz \
    usr/share/man/man5/sonard.toml.5.gz usr/share/bash-completion/completions/sonard \
    usr/share/zsh/vendor-completions/_sonard usr/share/fish/vendor_completions.d/sonard.fish \
    usr/share/doc/sonard/copyright usr/share/doc/sonard/examples/scenes/simple-room.json; do
    grep -qx "./$file" "$work/contents" || fail "the package lacks $file"
  done
  for unit in sonard.service sonard@.service sonard.socket; do
    grep -q "/systemd/system/$unit\$" "$work/contents" || fail "the package lacks $unit"
  done
  rm -rf "$work/control"
  dpkg-deb --control "$deb" "$work/control"
  grep -qx /etc/sonard/sonard.toml "$work/control/conffiles" || fail "the configuration is no conffile"
  dpkg-deb --extract "$deb" "$work/tree"
  # The oldest C library that has every symbol of the program.
  local wants has
  wants=$(objdump -T "$work/tree/usr/bin/sonard" 2>/dev/null || "aarch64-linux-gnu-objdump" -T "$work/tree/usr/bin/sonard")
  wants=$(grep -o 'GLIBC_2\.[0-9]*' <<<"$wants" | sort -Vu | tail -n 1 | sed s/GLIBC_//)
  has=$(dpkg-deb --field "$deb" Depends | grep -o 'libc6 (>= [0-9.]*)' | grep -o '[0-9.]*)' | tr -d ')')
  printf '%s\n%s\n' "$wants" "$has" | sort -VC || fail "the program needs libc6 $wants, the package requires $has"
  printf '%s: %s bytes, needs libc6 %s\n' "$(basename "$deb")" "$(stat -c %s "$deb")" "$wants"
}

test_arm64() {
  step "build for arm64"
  local deb
  deb=$(packaging/build.sh arm64 | tail -n 1)
  look_into "$deb" arm64
  readelf -h "$work/tree/usr/bin/sonard" | grep -q 'Machine: *AArch64' || fail "the program is not for AArch64"
  command -v qemu-aarch64 >/dev/null || tests/install.sh "" qemu-user
  step "run for arm64"
  # Programs that start a thread hang in some of these emulators: only what needs none is run.
  local run=(timeout 60 qemu-aarch64 -L /usr/aarch64-linux-gnu "$work/tree/usr/bin/sonard")
  "${run[@]}" --version
  "${run[@]}" scene check scenes/simple-room.json
  "${run[@]}" run --config config/sonard.toml --check >/dev/null 2>"$work/output" && fail "a daemon without a port is right"
  grep -q device.port "$work/output" || fail "$(cat "$work/output")"
}

get_tools() {
  packaging/build.sh tools
  local needed=()
  command -v lintian >/dev/null || needed+=(lintian)
  command -v man >/dev/null || needed+=(man-db)
  command -v systemd-nspawn >/dev/null || needed+=(systemd-container)
  if [ ${#needed[@]} != 0 ]; then tests/install.sh "" "${needed[@]}"; fi
  keep_debian
}

# test_here [dev]
test_here() {
  step "build"
  local deb architecture
  deb=$(packaging/build.sh "$@" | tail -n 1)
  architecture=$(dpkg --print-architecture)
  look_into "$deb" "$architecture"

  step "lintian"
  # A package outside of Debian's archive closes no bug there, and who gives it to others puts an
  # address into it.
  lintian --fail-on error,warning --allow-root "$deb" \
    --suppress-tags initial-upload-closes-no-bugs,bogus-mail-host,bogus-mail-host-in-debian-changelog ||
    fail "lintian finds fault with it"

  step "manual pages"
  local page printed
  for page in "$work"/tree/usr/share/man/man?/*.gz; do
    printed=$(LC_ALL=C.UTF-8 MANROFFSEQ='' MANWIDTH=80 man --warnings -E UTF-8 -l -Tutf8 -Z "$page" 2>&1 >/dev/null)
    [ -z "$printed" ] || fail "$(basename "$page"): $printed"
  done
  bash -n "$work/tree/usr/share/bash-completion/completions/sonard"

  step "a Debian of its own"
  local root=$work/root
  new_debian "$root"
  cp "$deb" "$root/tmp/new.deb"
  older "$deb" "$root/tmp/old.deb"
  cp packaging/lifecycle.sh "$root/tmp/"
  chroot "$root" /tmp/lifecycle.sh

  step "under a booted systemd"
  systemd/boot-test.sh "$deb"
}

# The same package with a version that is older, and another default in its configuration.
older() {
  local tree=$work/older
  dpkg-deb --raw-extract "$1" "$tree"
  sed -i 's/^Version: .*/Version: 0.0.9-1/' "$tree/DEBIAN/control"
  sed -i 's/^# Configuration of/# Older configuration of/' "$tree/etc/sonard/sonard.toml"
  rm -f "$tree/DEBIAN/md5sums"
  dpkg-deb -Zgzip -z1 --root-owner-group --build "$tree" "$2" >/dev/null
}

case ${1:-} in
"" | dev)
  get_tools
  test_here "$@"
  printf 'the package is right\n'
  ;;
arm64)
  test_arm64
  printf 'the package is right\n'
  ;;
tools) get_tools ;;
*) fail "for this computer (no argument), dev, arm64 or tools, not $1" ;;
esac

