# Sourced by test.sh: steps, what each of them took, and lanes: steps that run beside others, because they wait more than
# they compute, or because they build what no other step uses. Expects `work`, a folder for files.

# Seconds of processor time of all that has run so far, into `cpu_s`: a subshell would count its own.
count_cpu() {
  local file=$work/times-$BASHPID
  times >"$file"
  cpu_s=$(tail -n 1 "$file" | tr 'ms' '  ' | awk '{printf "%.0f", 60 * ($1 + $3) + $2 + $4}')
}

declare -A lanes
took=$work/took
step_name=
step() {
  end_step
  local name
  for name in "${!lanes[@]}"; do
    if [ -e "$work/failed-$name" ]; then join "$name"; fi
  done
  step_name=$*
  step_began=$SECONDS
  count_cpu
  step_cpu=$cpu_s
  printf '\n== %s\n' "$*"
}
end_step() {
  if [ -z "$step_name" ]; then return; fi
  count_cpu
  printf '%6d %6d  %s\n' $((SECONDS - step_began)) $((cpu_s - step_cpu)) "$step_name" >>"$took"
  step_name=
}
print_times() {
  end_step
  printf '\n== time\n  wall    cpu  step (seconds)\n'
  cat "$took"
  count_cpu
  printf '%6d %6d  all\n\n' "$SECONDS" "$cpu_s"
}

# lane NAME FUNCTION...: runs the functions one after the other beside what follows. Their output is kept until `join
# NAME`; a lane that fails ends all at the next step.
lane() {
  local name=$1
  shift
  # With a group of processes of its own, so that all of it can be ended.
  set -m
  (
    trap '[ $? = 0 ] || : >"$work/failed-$name"' EXIT
    lanes=()
    took=$work/took-$name
    step_name=
    for function in "$@"; do "$function"; done
    end_step
  ) >"$work/output-$name" 2>&1 </dev/null &
  set +m
  lanes[$name]=$!
}

# join NAME: waits for a lane, shows its output, and ends all if a step of it failed.
join() {
  end_step
  local name=$1 code=0 began=$SECONDS
  wait "${lanes[$name]}" || code=$?
  unset "lanes[$name]"
  cat "$work/output-$name"
  sed "s/\$/ (beside)/" "$work/took-$name" >>"$took" 2>/dev/null || true
  printf '%6d %6d  waited for %s\n' $((SECONDS - began)) 0 "$name" >>"$took"
  if [ "$code" != 0 ]; then fail "$name: see above"; fi
}

# Ends what lanes are still at, when all ends early.
end_lanes() {
  local name
  for name in "${!lanes[@]}"; do
    kill -TERM -- "-${lanes[$name]}" 2>/dev/null || true
    wait "${lanes[$name]}" 2>/dev/null || true
  done
}
