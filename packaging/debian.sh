# A throw-away Debian for tests; to be sourced from the repository's root.

# need PROGRAM PACKAGE: installs what is missing where it may, else says what to install.
need() {
  local program=$1 package=$2
  command -v "$program" >/dev/null && return
  if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
    printf '%s: %s is missing: sudo apt-get install %s\n' "$0" "$program" "$package" >&2
    return 1
  fi
  apt-get update -qq
  apt-get install -y -qq --no-install-recommends "$package" >/dev/null
}

# new_debian FOLDER: makes a Debian of this computer's release there, with systemd as its init. What
# the archive gave is kept for a week under target/tools, because fetching it takes a minute.
new_debian() {
  local root=$1 suite kept
  local packages=systemd,dbus,udev,procps,curl
  need mmdebstrap mmdebstrap
  suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
  kept=${CARGO_TARGET_DIR:-target}/tools/debian-$suite-${packages//,/-}.tar
  if [ -z "$(find "$kept" -mtime -7 2>/dev/null)" ]; then
    mkdir -p "$(dirname "$kept")"
    mmdebstrap --quiet --variant=apt --include="$packages" "$suite" "${kept%.tar}.new.tar" >/dev/null
    mv "${kept%.tar}.new.tar" "$kept"
  fi
  mkdir -p "$root"
  tar --extract --file "$kept" --directory "$root" --numeric-owner --xattrs --xattrs-include='*'
}
