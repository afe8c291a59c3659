# A throw-away Debian for tests; to be sourced from the repository's root.

# new_debian FOLDER: makes a Debian of this computer's release there, with systemd as its init.
new_debian() {
  keep_debian
  mkdir -p "$1"
  tar --extract --file "$kept_debian" --directory "$1" --numeric-owner --xattrs --xattrs-include='*'
}

# Downloads are kept for a week under target/tools, because fetching takes a minute; `kept_debian` prints the folder.
keep_debian() {
  local suite packages=systemd,dbus,udev,procps,curl,xz-utils
  command -v mmdebstrap >/dev/null || tests/install.sh "" mmdebstrap
  suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
  kept_debian=${CARGO_TARGET_DIR:-target}/tools/debian-$suite-${packages//,/-}.tar
  if [ -z "$(find "$kept_debian" -mtime -7 2>/dev/null)" ]; then
    mkdir -p "$(dirname "$kept_debian")"
    mmdebstrap --quiet --variant=apt --include="$packages" "$suite" "${kept_debian%.tar}.new.tar" >/dev/null
    mv "${kept_debian%.tar}.new.tar" "$kept_debian"
  fi
}
