#!/usr/bin/env bash
# Prints the compressed sizes of files, and fails if their total exceeds a limit.
# Usage: web/check-size.sh MAX_BYTES FILE...
set -euo pipefail
max_bytes=$1
shift
bytes=0
for file in "$@"; do
  size=$(gzip -9 -c "$file" | wc -c)
  bytes=$((bytes + size))
  printf '%8d  %s\n' "$size" "$(basename "$file")"
done
printf '%8d  total, compressed, bytes\n' "$bytes"
[ "$bytes" -lt "$max_bytes" ] || { echo "web/check-size.sh: the total exceeds $max_bytes bytes" >&2; exit 1; }
