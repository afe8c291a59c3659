#!/usr/bin/env bash
# Boots a throw-away Debian with systemd as PID 1 in a container, installs the daemon in it, and has
# boot-checks.sh do with the units what an administrator and bad luck do.
#
#   systemd/boot-test.sh target/debug/sonard     this program, and the units of this folder
#   systemd/boot-test.sh sonard_0.2.0-1_amd64.deb   a package, which is upgraded and removed as well
#
# Needs root, mounts and control groups, but no systemd on this computer. Where it can't be done it
# prints LEFT OUT with the reason, and ends with 0. Nothing is left behind, whatever fails.
set -euo pipefail
cd "$(dirname "$0")/.."
. packaging/debian.sh
subject=${1:?which program or package?}
boot_limit_s=300

fail() { printf 'systemd/boot-test.sh: %s\n' "$*" >&2; exit 1; }
leave_out() { printf 'units under a booted systemd: LEFT OUT, because %s\n' "$*"; exit 0; }

work=$(mktemp -d)
group=sonard-boot-test-$$
clean_up() {
  # The container's init dies with its keeper, and what is left of it takes its time under load.
  if [ -n "${keeper:-}" ] && kill -KILL "$keeper" 2>/dev/null; then wait "$keeper" 2>/dev/null || true; fi
  for hierarchy in "${hierarchies[@]}"; do
    for _ in $(seq 300); do
      [ -d "$hierarchy/$group" ] || break
      find "$hierarchy/$group" -name cgroup.procs -exec cat {} + 2>/dev/null |
        xargs --no-run-if-empty kill -KILL 2>/dev/null || true
      find "$hierarchy/$group" -depth -type d -exec rmdir {} + 2>/dev/null || sleep 0.1
    done
  done
  rmdir "/run/systemd/nspawn/propagate/$group" 2>/dev/null || true
  rm -rf --one-file-system "$work"
}
hierarchies=()
trap clean_up EXIT
trap 'exit 130' INT TERM HUP

# Where the container's systemd gets its control groups: its own hierarchy of version 1, version 2.
find_hierarchies() {
  local place
  for place in /sys/fs/cgroup/systemd /sys/fs/cgroup/unified /sys/fs/cgroup; do
    if [ -e "$place/cgroup.procs" ]; then hierarchies+=("$place"); fi
  done
}

check_place() {
  [ "$(id -u)" = 0 ] || leave_out "it needs root"
  unshare --mount --pid --fork --mount-proc true 2>/dev/null || leave_out "nothing may be mounted here"
  command -v apt-get >/dev/null || leave_out "it needs Debian or a relative of it"
  find_hierarchies
  [ ${#hierarchies[@]} != 0 ] || leave_out "there are no control groups in /sys/fs/cgroup"
  for hierarchy in "${hierarchies[@]}"; do
    mkdir "$hierarchy/$group" 2>/dev/null || leave_out "no control group can be made in $hierarchy"
  done
}

# As the package puts it.
install_program() {
  local root=$1
  install -D "$subject" "$root/usr/bin/sonard"
  install -D --mode=644 --target-directory="$root/usr/lib/systemd/system" systemd/sonard.service \
    systemd/sonard@.service systemd/sonard.socket
  install -D --mode=644 systemd/sonard.sysusers "$root/usr/lib/sysusers.d/sonard.conf"
  install -D --mode=644 systemd/sonard.tmpfiles "$root/usr/lib/tmpfiles.d/sonard.conf"
  install -D --mode=644 config/sonard.toml "$root/etc/sonard/sonard.toml"
}

# The same package as a later version.
later_package() {
  dpkg-deb --raw-extract "$1" "$work/later"
  sed -i 's/^Version: .*/Version: 99.0-1/' "$work/later/DEBIAN/control"
  dpkg-deb -Zgzip -z1 --root-owner-group --build "$work/later" "$2" >/dev/null
}

install_checks() {
  local root=$1
  install systemd/boot-checks.sh "$root/root/boot-checks.sh"
  cat >"$root/etc/systemd/system/boot-checks.service" <<'UNIT'
[Unit]
After=multi-user.target
SuccessAction=exit-force
FailureAction=exit-force
FailureActionExitStatus=1
[Service]
Type=oneshot
ExecStart=/root/boot-checks.sh
StandardOutput=append:/root/output
StandardError=append:/root/output
UNIT
  # Wanted by a target that multi-user.target does not wait for.
  mkdir -p "$root/etc/systemd/system/default.target.wants"
  ln -sf /usr/lib/systemd/system/multi-user.target "$root/etc/systemd/system/default.target"
  ln -s ../boot-checks.service "$root/etc/systemd/system/default.target.wants/"
  # The journal is read from outside when something failed.
  mkdir -p "$root/var/log/journal"
  : >"$root/root/output"
}

boot() {
  local root=$1 hierarchy
  local options=(--directory="$root" --machine="$group" --register=no --private-network --boot
    --console=pipe --quiet --link-journal=no --capability=CAP_MKNOD)
  # Without systemd on the host the container has no unit of its own.
  [ -d /run/systemd/system ] || options+=(--keep-unit)
  (
    for hierarchy in "${hierarchies[@]}"; do echo "$BASHPID" >"$hierarchy/$group/cgroup.procs"; done
    exec systemd-nspawn "${options[@]}" </dev/null >"$work/console" 2>&1
  ) &
  keeper=$!
  for _ in $(seq "$boot_limit_s"); do
    kill -0 "$keeper" 2>/dev/null || break
    sleep 1
  done
  if kill -KILL "$keeper" 2>/dev/null; then
    wait "$keeper" 2>/dev/null || true
    keeper=
    report "$root"
    fail "the checks did not end within $boot_limit_s s of booting"
  fi
  local code=0
  wait "$keeper" || code=$?
  keeper=
  if [ "$code" != 0 ] || ! grep -qx 'all checks passed' "$root/root/output"; then
    report "$root"
    fail "see above (exit code $code)"
  fi
  grep -v '^all checks passed$' "$root/root/output"
}

report() {
  tail -n 20 "$work/console" >&2
  journalctl --directory="$1/var/log/journal" --no-pager --output=short-monotonic 2>/dev/null | tail -n 120 >&2 || true
  cat "$1/root/output" >&2
}

check_place
command -v systemd-nspawn >/dev/null || tests/install.sh "" systemd-container
root=$work/root
new_debian "$root"
case $subject in
*.deb)
  cp "$subject" "$root/root/sonard.deb"
  later_package "$subject" "$root/root/later.deb"
  ;;
*) install_program "$root" ;;
esac
install_checks "$root"
boot "$root"
printf 'units are right under %s\n' "$(chroot "$root" systemctl --version | head -n 1)"
