#!/usr/bin/env bash
# A data set by GNU parallel, on one computer or several:
#
#   parallel.sh rooms.toml rooms 20 [OPTION OF PARALLEL...]      as --sshloginfile nodes
#
# A job that fails is tried again; given once more, the command does again those that failed (--resume-failed) and no other.
set -euo pipefail
spec=$1 out=$2 parts=$3
shift 3
export RAYON_NUM_THREADS=1
seq "$parts" | parallel --jobs "${WORKERS:-100%}" --retries 3 --joblog "$out.joblog" --resume-failed --env RAYON_NUM_THREADS \
  "$@" "${SONARD:-sonard}" generate "$spec" --out "$out" --shard "{}/$parts"
# Who was last may not have seen that it was.
"${SONARD:-sonard}" generate "$spec" --out "$out" --shard 1/1
