#!/bin/sh
# Installs sonard for this user, without root and without a compiler:
#
#   sh install.sh --from URL|FOLDER    where SHA256SUMS and the archives of a release are [default: this script's folder]
#   sh install.sh --prefix FOLDER      installation folder [default: ~/.local]
#   sh install.sh --uninstall          removes what was installed
#
# The archive is selected by system, processor and C library, and its SHA-256 digest is verified before unpacking. The
# smaller archive, .tar.xz, is taken where the program xz unpacks it.
set -eu
version=@VERSION@
# Oldest glibc of the programs that are linked against it.
glibc_minor=31

fail() { printf 'install.sh: %s\n' "$*" >&2; exit 1; }

from=$(dirname "$0") prefix=${HOME:-}/.local action=install
while [ $# != 0 ]; do
  case $1 in
  --from) from=${2:?--from: where?} && shift 2 ;;
  --prefix) prefix=${2:?--prefix: where?} && shift 2 ;;
  --uninstall) action=uninstall && shift ;;
  -h | --help) sed -n '2,9s/^# \{0,1\}//p' "$0" && exit ;;
  *) fail "unknown option $1" ;;
  esac
done
case $prefix in
/.local) fail "HOME is not set; name a folder: --prefix FOLDER" ;;
/*) ;;
*) prefix=$PWD/$prefix ;;
esac
list=$prefix/share/sonard/installed

uninstall() {
  remove_files
  rmdir "$prefix" 2>/dev/null || true
  printf 'removed sonard from %s\n' "$prefix"
}

# Removes the files of the list, and the folders that are empty then.
remove_files() {
  [ -r "$list" ] || fail "nothing is installed in $prefix"
  while read -r file; do rm -f "$prefix/$file"; done <"$list"
  folders=$(while read -r file; do
    while [ "$file" != "${file%/*}" ]; do file=${file%/*} && printf '%s\n' "$file"; done
  done <"$list" | sort -ur)
  rm -f "$list"
  for folder in $folders share/sonard share; do rmdir "$prefix/$folder" 2>/dev/null || true; done
}

# fetch NAME FILE: copies a file of the release.
fetch() {
  case $from in
  http://* | https://*)
    if command -v curl >/dev/null; then
      curl --fail --silent --show-error --location --output "$2" "${from%/}/$1"
    else
      wget -q -O "$2" "${from%/}/$1" || fail "cannot fetch $1; install curl or wget"
    fi
    ;;
  *) cp "$from/$1" "$2" 2>/dev/null ;;
  esac || fail "no $1 in $from; --from names the folder or URL of a release"
}

# Prints the processor and C library, as the archives' names have them.
target() {
  system=$(uname -s)
  [ "$system" = Linux ] || fail "there is no program for $system: build it from source (docs/install.md)"
  case $(uname -m) in
  x86_64 | amd64) processor=x86_64 ;;
  aarch64 | arm64) processor=aarch64 ;;
  *) fail "there is no program for $(uname -m): build it from source (docs/install.md)" ;;
  esac
  library=musl
  minor=$(getconf GNU_LIBC_VERSION 2>/dev/null | sed -n 's/^glibc 2\.\([0-9]*\).*/\1/p')
  if [ "${minor:-0}" -ge "$glibc_minor" ] && grep -q -- "-$processor-unknown-linux-gnu.tar.gz" "$work/SHA256SUMS"; then
    library=gnu
  fi
  printf '%s-unknown-linux-%s' "$processor" "$library"
}

# fetch_verified ARCHIVE: copies an archive of the release, and verifies its digest.
fetch_verified() {
  fetch "$1" "$work/$1"
  expected=$(sed -n "s/  $1\$//p" "$work/SHA256SUMS")
  found=$(sha256sum "$work/$1")
  [ -n "$expected" ] && [ "${found%% *}" = "$expected" ] || fail "the digest of $1 is not that of SHA256SUMS"
}

install() {
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  fetch SHA256SUMS "$work/SHA256SUMS"
  name=sonard-$version-$(target)
  # Some systems have an xz without the filter for machine code.
  if grep -q -- "  $name.tar.xz\$" "$work/SHA256SUMS" && command -v xz >/dev/null &&
    fetch_verified "$name.tar.xz" && xz -d "$work/$name.tar.xz" 2>/dev/null; then
    tar -x -f "$work/$name.tar" -C "$work"
  else
    fetch_verified "$name.tar.gz"
    tar -x -z -f "$work/$name.tar.gz" -C "$work"
  fi
  if [ -r "$list" ]; then
    remove_files
  elif [ -e "$prefix/bin/sonard" ]; then
    fail "$prefix/bin/sonard is there, but not from this script: remove it, or name another folder by --prefix"
  fi
  mkdir -p "$prefix/share/sonard" "$prefix/bin" 2>/dev/null || fail "$prefix is not writable; --prefix names another folder"
  (cd "$work/$name" && find . -type f | sed 's|^\./||' | sort) >"$list"
  cp -R "$work/$name/." "$prefix/"
  printf 'installed %s in %s\n' "$name" "$prefix"
  case :$PATH: in
  *:"$prefix/bin":*) ;;
  *) printf 'add it to the path: export PATH="%s/bin:$PATH"\n' "$prefix" ;;
  esac
}

$action
