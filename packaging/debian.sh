# A throw-away Debian for tests; to be sourced from the repository's root.

# new_debian FOLDER: makes a Debian of this computer's release there, with systemd as its init. What
# the archive gave is kept for a week under target/tools, because fetching it takes a minute.
new_debian() {
  local root=$1 suite kept
  local packages=systemd,dbus,udev,procps,curl
  command -v mmdebstrap >/dev/null || tests/install.sh "" mmdebstrap
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
