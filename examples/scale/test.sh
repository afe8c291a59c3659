#!/usr/bin/env bash
# Runs the examples for Ray, Dask, GNU parallel and Slurm on this computer, kills a worker of each in the middle of a shard, and
# holds the set against the one that a single process made, byte for byte. Prints readings a second for one and two
# workers, and bytes a reading.
#
#   examples/scale/test.sh [PROGRAM]     a release build; without it target/release/sonard, built if it is not there
#   READINGS=1000000 ...                 how many, in place of 10^7
#   ENGINES="parallel ray" ...           which, in place of all: single ray dask parallel slurm
#
# Ray and Dask come from PyPI (some 300 MB, into target/tools/scale), the wheel from python/test.sh, GNU parallel and Slurm
# from Debian, where this may install them.
set -euo pipefail
cd "$(dirname "$0")/../.."
root=$PWD
program=${1:-target/release/sonard}
[ -x "$program" ] || cargo build --release --bin sonard --quiet
SONARD=$(realpath "$program")
export SONARD
readings=${READINGS:-10000000}
engines=${ENGINES:-single ray dask parallel slurm}
work=$(mktemp -d)
own=()
killer=
finish() {
  # Only what was started here.
  for pid in "${own[@]}" $killer; do kill "$pid" 2>/dev/null || true; done
  rm -rf "$work"
}
trap finish EXIT
fail() { printf 'examples/scale/test.sh: %s\n' "$*" >&2; exit 1; }

parts=20
cat >"$work/set.toml" <<END
[set]
name = "ranges in simple-room"
shards = $parts
scenes = 1
poses = $((readings / parts / 400))
[[scene]]
shape = "file"
file = "simple-room"
END
expected=$((readings / parts / 400 * 400 * parts))

need_debian() {
  local missing=()
  for package in "$@"; do dpkg-query -W "$package" >/dev/null 2>&1 || missing+=("$package"); done
  if [ ${#missing[@]} = 0 ]; then return; fi
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || fail "missing here: sudo apt-get install ${missing[*]}"
  apt-get update -qq && apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

digest() { sed -n 's/^  "sha256": "\(.*\)",$/\1/p' "$1/manifest.json"; }
bytes() { sed -n 's/^    "bytes": \([0-9]*\),$/\1/p' "$1/manifest.json" | head -n 1; }

# run ENGINE WORKERS OUT COMMAND...: with the time that it took.
run() {
  local engine=$1 workers=$2 out=$3 began ended
  shift 3
  began=$(date +%s.%N)
  WORKERS=$workers "$@" >"$work/output" 2>&1 || { cat "$work/output" >&2; fail "$engine failed"; }
  ended=$(date +%s.%N)
  report "$engine" "$workers" "$out" "$began" "$ended"
}

report() {
  local same=same
  [ "$(digest "$3")" = "$wanted" ] || same=DIFFERENT
  awk -v engine="$1" -v workers="$2" -v n="$expected" -v t="$(echo "$5 $4" | awk '{print $1 - $2}')" -v bytes="$(bytes "$3")" -v same=$same \
    'BEGIN { printf "%-22s %d workers  %6.1f s  %7.0f readings/s  %.2f bytes a reading  %s\n", engine, workers, t, n / t, bytes / n, same }'
  [ $same = same ] || fail "$1: another digest"
  "$SONARD" generate --verify "$3" >/dev/null || fail "$1: not as it should be"
}

# kill_one OUT: ends, as a crash would, a process that makes a shard in OUT; waits for the middle of one first.
kill_one() {
  local open pid
  for _ in $(seq 3000); do
    open=$(find /proc/[0-9]*/fd -maxdepth 1 -lname "$1/*.draft/readings.parquet" 2>/dev/null | head -n 1) || true
    if [ -n "$open" ]; then
      pid=$(cut -d / -f 3 <<<"$open")
      printf 'killed %s (%s) while it wrote %s\n' "$pid" "$(tr '\0' ' ' <"/proc/$pid/cmdline" | cut -c1-60)" \
        "$(readlink "$open" | sed "s,^$1/,,")"
      kill -9 "$pid"
      return
    fi
    sleep 0.02
  done
  fail "no worker was found in $1"
}

# With a kill in the middle.
run_killed() {
  local engine=$1 out=$3
  mkdir -p "$out"
  kill_one "$out" &
  killer=$!
  run "$engine, one killed" "$2" "$out" "${@:4}"
  wait "$killer" || fail "$engine: no worker was killed"
  killer=
}

single() { RAYON_NUM_THREADS=$WORKERS "$SONARD" generate "$work/set.toml" --out "$1"; }

by_slurm() {
  (cd "$work" && sbatch --wait --array="1-$parts%$WORKERS" --chdir="$work" "$root/examples/scale/slurm.sbatch" "$work/set.toml" "$1")
  "$SONARD" generate "$work/set.toml" --out "$1" --shard 1/1
}

# A controller and a node on this computer, without cgroups.
start_slurm() {
  need_debian slurmctld slurmd slurm-client munge
  local host
  host=$(hostname -s)
  mkdir -p "$work/slurm/state" "$work/slurm/spool" /run/munge
  if ! munge -n </dev/null >/dev/null 2>&1; then
    [ -e /etc/munge/munge.key ] || fail "munge has no key"
    chown munge: /run/munge
    # Its own user, as its key is; where that may not write logs, --force continues with a message.
    runuser -u munge -- munged --force --foreground >"$work/slurm/munged.log" 2>&1 &
    own+=($!)
    sleep 1
  fi
  export SLURM_CONF=$work/slurm/slurm.conf
  cat >"$SLURM_CONF" <<END
ClusterName=here
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=1
ReturnToService=2
MinJobAge=300
StateSaveLocation=$work/slurm/state
SlurmdSpoolDir=$work/slurm/spool
SlurmctldPidFile=$work/slurm/slurmctld.pid
SlurmdPidFile=$work/slurm/slurmd.pid
SlurmctldLogFile=$work/slurm/slurmctld.log
SlurmdLogFile=$work/slurm/slurmd.log
SlurmctldPort=16817
SlurmdPort=16818
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
  slurmctld -D >/dev/null 2>&1 &
  own+=($!)
  slurmd -D >/dev/null 2>&1 &
  own+=($!)
  for _ in $(seq 60); do
    if sinfo -h -o %t 2>/dev/null | grep -q idle; then return; fi
    sleep 0.5
  done
  tail -n 20 "$work/slurm"/*.log >&2
  fail "Slurm does not start here"
}

printf '%s readings in %s shards\n' "$expected" "$parts"
wanted=
WORKERS=1 single "$work/first" >/dev/null 2>&1
wanted=$(digest "$work/first")
printf 'digest of a single process, one thread: %s\n' "$wanted"
for engine in $engines; do
  case $engine in
  single)
    for workers in 1 2; do run "one process" $workers "$work/single-$workers" single "$work/single-$workers"; done
    ;;
  ray | dask)
    tests/venv.sh target/tools/scale SCALE=0 "ray==2.60.0" "distributed==2026.8.0" numpy
    python=$root/target/tools/scale/bin/python
    wheel=$(ls python/target/wheels/*.whl 2>/dev/null) || fail "there is no wheel: python/test.sh makes one"
    "$python" -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
    script=$root/examples/scale/generate_$engine.py
    for workers in 1 2; do
      run $engine $workers "$work/$engine-$workers" "$python" "$script" "$work/set.toml" "$work/$engine-$workers" $parts
    done
    run_killed $engine 2 "$work/$engine-killed" "$python" "$script" "$work/set.toml" "$work/$engine-killed" $parts
    ;;
  parallel)
    need_debian parallel
    for workers in 1 2; do
      run parallel $workers "$work/parallel-$workers" examples/scale/parallel.sh "$work/set.toml" "$work/parallel-$workers" $parts
    done
    run_killed parallel 2 "$work/parallel-killed" examples/scale/parallel.sh "$work/set.toml" "$work/parallel-killed" $parts
    ;;
  slurm)
    start_slurm
    for workers in 1 2; do run slurm $workers "$work/slurm-$workers" by_slurm "$work/slurm-$workers"; done
    ;;
  *) fail "no engine $engine" ;;
  esac
done
printf 'all digests are the same\n'
