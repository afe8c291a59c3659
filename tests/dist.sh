#!/usr/bin/env bash
# Installs a release as users do, without a compiler: runs README's first command, uninstalls, and looks for residue.
# Prints one row of a table for each way.
#
#   tests/dist.sh                   the release that `cargo xtask dist` has built
#   tests/dist.sh PROGRAM [WHEEL]   archives that are packed around this program and wheel, which takes no release build
#
# Ways whose artefact or tool is missing are LEFT OUT, and named. Needs root for the bare systems.
set -euo pipefail
cd "$(dirname "$0")/.."
. packaging/debian.sh
target=$(realpath "${CARGO_TARGET_DIR:-target}")
work=$(mktemp -d)
trap 'rm -rf --one-file-system "$work"' EXIT
fail() { printf 'tests/dist.sh: %s\n' "$*" >&2; exit 1; }
rows=$work/rows
row() { printf '| %s | %s | %s | %s | %s |\n' "$@" >>"$rows"; }
leave_out() { row "$1" "untested: $2" - - -; }
scan=(scan --mock --scene simple-room --pose fig9 --out out/fig9)
machine=$(uname -m)

pack() {
  dist=$work/dist
  strip -o "$work/sonard" "$1"
  local wheel=()
  if [ -n "${2:-}" ]; then wheel=(--wheel "$2"); fi
  cargo xtask dist --only binary,installer,sbom"${2:+,wheel}" --target "$machine-unknown-linux-gnu" \
    --program "$work/sonard" "${wheel[@]}" --out "$dist" >/dev/null
}

# timed COMMAND...: seconds that it takes, into `took`.
timed() {
  local began=$EPOCHREALTIME
  "$@" >"$work/output" 2>&1 || fail "$*: $(cat "$work/output")"
  took=$(awk "BEGIN { printf \"%.1f\", $EPOCHREALTIME - $began }")
}
megabytes() { du --bytes --total "$@" | tail -n 1 | awk '{ printf "%.1f", $1 / 1e6 }'; }

# within ROOT COMMAND...: runs a command in a root with terminals, apart from this system's mounts.
within() {
  unshare --mount --fork bash -c '
    mkdir -p "$1/dev/pts" "$1/proc"
    mount -t proc proc "$1/proc"
    mount -t devpts -o newinstance,ptmxmode=0666,mode=620 devpts "$1/dev/pts"
    [ -e "$1/dev/ptmx" ] || ln -s pts/ptmx "$1/dev/ptmx"
    exec chroot "$@"' bash "$@"
}

# A user without root installs in a Debian without a compiler.
try_installer() {
  local platform="Debian $(. /etc/os-release && echo "$VERSION_CODENAME"), $machine" root=$work/debian archive
  new_debian "$root"
  ! chroot "$root" sh -c 'command -v cc || command -v cargo' || fail "the bare Debian has a compiler"
  cp -r "$dist" "$root/dist"
  chroot "$root" useradd --create-home user
  chroot "$root" find /home/user | sort >"$work/before"
  archive=$(find "$dist" -name "*-$machine-unknown-linux-gnu.tar.xz")
  cat >"$root/first.sh" <<END
set -eu
cd && export HOME=\$PWD
sh /dist/install.sh --from /dist
PATH=\$HOME/.local/bin:\$PATH
sonard ${scan[*]}
END
  timed within "$root" setpriv --reuid user --regid user --clear-groups env HOME=/home/user sh /first.sh
  [ -s "$root/home/user/out/fig9/scan.png" ] || fail "no picture: $(cat "$work/output")"
  row "$platform" "install.sh, then the first scan" "$took" "$(megabytes "$archive")" no
  as_user() { chroot "$root" setpriv --reuid user --regid user --clear-groups env HOME=/home/user "$@"; }
  # rejects PART OPTION...: the installer fails with a message that contains PART.
  rejects() {
    local part=$1
    shift
    if as_user sh /dist/install.sh "$@" >"$work/output" 2>&1; then fail "install.sh $* succeeds"; fi
    grep -q -- "$part" "$work/output" || fail "install.sh $*: $(cat "$work/output")"
  }
  # installs_from SUFFIX: with only that archive at hand, a second installation leaves a program that runs.
  installs_from() {
    rm "$root"/dist/*.tar.?z
    cp "$dist/$(basename "$archive" .xz).$1" "$root/dist"
    as_user sh /dist/install.sh >"$work/output" 2>&1 || fail "install.sh with .$1 only: $(cat "$work/output")"
    as_user /home/user/.local/bin/sonard --version >/dev/null || fail "a second installation breaks the first"
  }
  installs_from xz
  # Without xz, or with one that lacks a filter, the other archive is unpacked.
  mv "$root/usr/bin/xz" "$root/usr/bin/xz.away"
  installs_from gz
  printf '#!/bin/sh\nexit 1\n' >"$root/usr/bin/xz"
  chmod +x "$root/usr/bin/xz"
  cp "$archive" "$root/dist"
  as_user sh /dist/install.sh >"$work/output" 2>&1 || fail "install.sh with a broken xz: $(cat "$work/output")"
  mv "$root/usr/bin/xz.away" "$root/usr/bin/xz"
  rejects 'no SHA256SUMS' --from /nowhere
  rejects 'not writable' --prefix /opt
  rejects 'nothing is installed' --prefix /opt --uninstall
  rejects 'is not writable' --prefix /etc/hostname
  as_user sh -c 'cd && sh /dist/install.sh --prefix "other tools"' >"$work/output"
  grep -q 'PATH="/home/user/other tools/bin:' "$work/output" || fail "a relative folder: $(cat "$work/output")"
  as_user sh -c 'cd && sh /dist/install.sh --prefix "other tools" --uninstall' >/dev/null
  mkdir -p "$root/other/bin"
  touch "$root/other/bin/sonard"
  rejects 'not from this script' --prefix /other
  as_user sh -c 'rm -r "$HOME/out" && sh /dist/install.sh --uninstall' >/dev/null
  chroot "$root" find /home/user | sort | diff "$work/before" - || fail "uninstalling leaves files"
  # A changed archive is rejected, and leaves nothing.
  local suffix
  for suffix in xz gz; do
    rm -f "$root"/dist/*.tar.?z
    cp "$dist/$(basename "$archive" .xz).$suffix" "$root/dist"
    printf x >>"$root/dist/$(basename "$archive" .xz).$suffix"
    if [ "$suffix" = gz ]; then rm "$root/usr/bin/xz"; fi
    rejects 'digest' --from /dist
    chroot "$root" find /home/user | sort | diff "$work/before" - || fail "a rejected archive leaves files"
  done
}

# Root installs the Debian package in a bare Debian, and purges it.
try_package() {
  local platform="Debian $(. /etc/os-release && echo "$VERSION_CODENAME"), $machine" package root=$work/package
  package=$(find "$dist" -name "sonard_*_$(dpkg --print-architecture).deb")
  if [ -z "$package" ]; then leave_out "$platform, package" "no package is built"; return; fi
  new_debian "$root"
  cp "$package" "$root/tmp/sonard.deb"
  cat >"$root/first.sh" <<END
set -eu
dpkg --install /tmp/sonard.deb
cd /tmp
sonard ${scan[*]}
END
  timed within "$root" sh /first.sh
  [ -s "$root/tmp/out/fig9/scan.png" ] || fail "no picture: $(cat "$work/output")"
  row "$platform" "dpkg --install, then the first scan" "$took" "$(megabytes "$package")" yes
  chroot "$root" dpkg --purge sonard >"$work/output" 2>&1 || fail "dpkg --purge: $(cat "$work/output")"
  [ -z "$(find "$root/etc" "$root/usr" -name '*sonard*')" ] || fail "purging leaves $(find "$root/etc" "$root/usr" -name '*sonard*')"
}

# A root without a C library: busybox, and what is installed there.
try_static() {
  local platform="busybox without C library, $machine" archive root=$work/static busybox
  archive=$(find "$dist" -name "*-$machine-unknown-linux-musl.tar.xz")
  if [ -z "$archive" ]; then leave_out "$platform" "no static program is built"; return; fi
  busybox=$(command -v busybox) || { tests/install.sh "" busybox-static && busybox=$(command -v busybox); }
  if ldd "$busybox" >/dev/null 2>&1; then leave_out "$platform" "the busybox here is not static"; return; fi
  mkdir -p "$root/bin" "$root/dev" "$root/tmp" "$root/home"
  cp "$busybox" "$root/bin/busybox"
  chroot "$root" /bin/busybox --install -s /bin
  mknod -m 666 "$root/dev/null" c 1 3
  cp -r "$dist" "$root/dist"
  find "$root/home" | sort >"$work/before"
  cat >"$root/first.sh" <<END
set -eu
export HOME=/home PATH=/home/.local/bin:/bin
cd /home
sh /dist/install.sh
sonard ${scan[*]}
END
  timed within "$root" /bin/sh /first.sh
  [ -s "$root/home/out/fig9/scan.png" ] || fail "no picture: $(cat "$work/output")"
  row "$platform" "install.sh, then the first scan" "$took" "$(megabytes "$archive")" no
  chroot "$root" /bin/env HOME=/home PATH=/bin sh -c 'rm -r /home/out && sh /dist/install.sh --uninstall' >/dev/null
  find "$root/home" | sort | diff "$work/before" - || fail "uninstalling leaves files"
}

# A fresh environment of Python that takes packages from a folder.
try_wheel() {
  local platform="Python $(python3 -c 'import platform; print(platform.python_version())'), $machine" wheel
  wheel=$(find "$dist" -name "sonard-*$machine.whl" ! -name '*musllinux*')
  if [ -z "$wheel" ]; then leave_out "$platform" "no wheel is built"; return; fi
  mkdir "$work/index"
  cp "$wheel" "$work/index"
  python3 -m venv "$work/venv"
  "$work/venv/bin/pip" download --quiet --disable-pip-version-check --dest "$work/index" 'numpy>=1.23'
  find "$work/venv" -name __pycache__ -prune -o -print | sort >"$work/before"
  cat >"$work/wheel.sh" <<END
set -e
cd "$work"
venv/bin/pip install --quiet --disable-pip-version-check --no-index --find-links index sonard
venv/bin/sonard ${scan[*]}
END
  timed bash "$work/wheel.sh"
  [ -s "$work/out/fig9/scan.png" ] || fail "no picture: $(cat "$work/output")"
  (cd "$work" && venv/bin/python -c 'import sonard; sonard.Scene.shipped("simple-room")') || fail "the Python package"
  row "$platform" "pip install sonard, then the first scan" "$took" "$(megabytes "$work"/index/*)" no
  "$work/venv/bin/pip" uninstall --quiet --yes --disable-pip-version-check sonard numpy
  find "$work/venv" -name __pycache__ -prune -o -print | sort | diff "$work/before" - || fail "uninstalling leaves files"
}

# Programs for aarch64 under qemu-user, which lacks what pseudo-terminals need: model and drawings, and the predictions
# of both processors. Without a release for this processor, its program is not compared.
try_aarch64() {
  local platform="aarch64 in qemu-user" archive own package folder=$work/aarch64
  archive=$(find "$dist" -name "*-aarch64-unknown-linux-musl.tar.xz")
  if [ -z "$archive" ]; then leave_out "$platform" "no program for aarch64 is built"; return; fi
  command -v qemu-aarch64 >/dev/null || tests/install.sh "" qemu-user
  unpack() { mkdir "$2" && tar --extract --file "$1" --directory "$2" --strip-components 2 --wildcards '*/bin/sonard'; }
  unpack "$archive" "$folder"
  cat >"$work/aarch64.sh" <<END
set -e
cd "$folder"
qemu-aarch64 ./sonard simulate --scene simple-room --pose fig9 --output scan.jsonl
qemu-aarch64 ./sonard plot scan.jsonl --output scan.png
END
  timed timeout 60 bash "$work/aarch64.sh"
  [ -s "$folder/scan.png" ] || fail "no picture: $(cat "$work/output")"
  row "$platform" "simulate, plot" "$took" "$(megabytes "$archive")" no
  own=$(find "$dist" -name "*-$machine-unknown-linux-musl.tar.xz")
  if [ -n "$own" ]; then
    unpack "$own" "$work/own"
    "$work/own/sonard" simulate --scene simple-room --pose fig9 --output "$work/own/scan.jsonl"
    python3 - "$folder/scan.jsonl" "$work/own/scan.jsonl" <<'END' || fail "the processors' predictions differ"
import json, sys
ranges = [[r["range_m"] for r in map(json.loads, open(log)) if r["type"] == "ping"] for log in sys.argv[1:]]
assert len(ranges[0]) == len(ranges[1]) == 400, [len(r) for r in ranges]
for index, (one, other) in enumerate(zip(*ranges)):
    assert (one is None) == (other is None) and (one is None or abs(one - other) < 1e-9), (index, one, other)
END
  fi
  package=$(find "$dist" -name 'sonard_*_arm64.deb')
  if [ -n "$package" ] && [ -d /usr/aarch64-linux-gnu/lib ]; then
    dpkg-deb --extract "$package" "$work/arm64"
    timed qemu-aarch64 -L /usr/aarch64-linux-gnu "$work/arm64/usr/bin/sonard" scene check scenes/simple-room.json
    row "$platform, package" "scene check" "$took" "$(megabytes "$package")" yes
  fi
  if (cd "$folder" && timeout 120 qemu-aarch64 ./sonard "${scan[@]}") >/dev/null 2>&1; then
    (cd "$folder" && rm -rf out && timed qemu-aarch64 ./sonard "${scan[@]}" && printf '%s' "$took" >took)
    row "$platform" "the first scan" "$(cat "$folder/took")" "$(megabytes "$archive")" no
  else
    leave_out "$platform, the first scan" "no pseudo-terminals there"
  fi
}

# The archive of the source compiles without a network and without the crates of this computer.
check_source() {
  local archive
  archive=$(find "$dist" -name 'sonard-*-source.tar.gz')
  if [ -z "$archive" ]; then leave_out "source" "no archive of it is built"; return; fi
  mkdir "$work/source"
  tar --extract --file "$archive" --directory "$work/source" --strip-components 1
  (cd "$work/source" && CARGO_HOME=$work/no-crates CARGO_TARGET_DIR=$work/source/target \
    unshare --net cargo check --offline --locked --quiet) || fail "the source does not compile without a network"
}

# Checks that archives, wheels and packages contain no path or name of this computer.
look_for_traces() {
  local trace file traces=("$PWD" "$target" "${CARGO_HOME:-$HOME/.cargo}" "${RUSTUP_HOME:-$HOME/.rustup}")
  # A short name is part of other words.
  if [ "$(uname -n | wc -c)" -gt 6 ]; then traces+=("$(uname -n)"); fi
  for file in "$dist"/*.tar.gz "$dist"/*.whl "$dist"/*.deb; do
    mkdir -p "$work/traces"
    case $file in
    *-source.tar.gz | *'*'*) continue ;;
    *.tar.gz) tar --extract --file "$file" --directory "$work/traces" ;;
    *.whl) python3 -m zipfile --extract "$file" "$work/traces" ;;
    *.deb) dpkg-deb --extract "$file" "$work/traces" ;;
    esac
    for trace in "${traces[@]}"; do
      if grep -rqF -- "$trace" "$work/traces"; then fail "$(basename "$file") contains $trace"; fi
    done
    rm -rf "$work/traces"
  done
}

is_release=
case $# in
0) dist=$target/dist is_release=1 ;;
*) pack "$@" ;;
esac
[ -e "$dist/SHA256SUMS" ] || fail "no release in $dist: cargo xtask dist"
(cd "$dist" && sha256sum --quiet --check SHA256SUMS)
# Programs of tests have paths of this computer in their debug information.
if [ -n "$is_release" ]; then look_for_traces; fi
if [ "$(id -u)" = 0 ] && unshare --mount true 2>/dev/null; then
  try_installer
  try_package
  try_static
  if [ -n "$is_release" ]; then check_source; fi
else
  leave_out "bare Debian, root with the program alone" "needs root and mounts"
fi
try_wheel
try_aarch64
row 'macOS, Windows' 'untested: linted only' - - -
printf '| platform | command | seconds | MB | root |\n| --- | --- | ---: | ---: | --- |\n'
cat "$rows"
