#!/usr/bin/env bash
# Tests of a change, in three tiers. Each installs what is missing where it may, else names it, and prints the time of its
# steps.
#
#   ./test.sh quick      format, Clippy, unit tests, layers of the crates, wording
#   ./test.sh            the above, tests of the program, doctests, smoke tests of page, playground and Python
#   ./test.sh all        the above, long tests, browser tests, firmware and emulator, other programs, API fuzzer, package,
#                        booted units, fuzz targets, Python package, documentation: what CI runs
#
# Switches of the last two:
#   PAGE=0               without the live page (Chromium)
#   PLAYGROUND=0         without the playground (WebAssembly target; in `all` also npm and node)
#   PYTHON=0             without the Python package (Python, PyPI)
# Switches of `all`:
#   FUZZ_SECONDS=60      time for each fuzz target (default 8; 0: none)
#   FIRMWARE=0           without firmware and emulator (Debian packages: firmware/test.sh)
#   AXE=0                without axe-core (npm)
#   SCHEMATHESIS=0       without the API fuzzer (PyPI)
#   EXPORT_PEERS=0       without other programs that read exports (PyPI)
#   IMPORT_PEERS=0       without tools of the formats that are imported (PyPI)
#   FOXGLOVE_PEER=0      without Foxglove's client library (npm, node)
#   ROS_PEER=0           without Cyclone DDS (PyPI, a network namespace)
#   MQTT_PEER=0          without mosquitto (Debian packages)
#   PROMTOOL=0           without promtool (Debian package prometheus)
#   FAKETIME=0           without the clock that is set (libfaketime)
#   PLATFORMS=0          without Clippy for macOS and Windows, and for the Python package
#   INSTRUCTIONS=0       without instruction counts (Debian package valgrind)
#   DIST=0               without the installation of a release that is packed around the tests' program
#   BOOT=0               without units under a booted systemd (systemd/boot-test.sh)
#   PACKAGE=1            with the Debian package around the tests' program: build, installation, upgrade, removal;
#                        PACKAGE=release with the release build, PACKAGE=all also for a Raspberry Pi
#   SONARD_SOAK_FAULTS=1000 SONARD_KILLS=200 SONARD_COLLECT_KILLS=200   more faults and kills
# Other random cases: PROPTEST_RNG_SEED=$RANDOM PROPTEST_CASES=5000 ./test.sh quick
#
# Cargo gets the same packages and features in every step of a tier, so that nothing is built twice. Steps that mostly wait
# run beside others (tests/steps.sh), the tests by themselves at the end: by cargo-nextest if installed, else by cargo test.
set -euo pipefail
cd "$(dirname "$0")"
root=$PWD
tier=${1:-default}
fuzz_seconds=${FUZZ_SECONDS:-8}
if [ "$tier" != all ]; then fuzz_seconds=0; fi
work=$(mktemp -d)
trap 'end_lanes; rm -rf "$work"' EXIT

fail() { printf 'test.sh: %s\n' "$*" >&2; exit 1; }
# NAME STEP: true, and printed as a step, if NAME=0 leaves it out.
left_out() {
  [ "${!1:-1}" = 0 ] || return 1
  step "$2: LEFT OUT, because $1=0"
}
. tests/steps.sh
# What computes beside programs that are timed leaves them the processors.
gently() { nice -n 10 "$@"; }

check_tools() {
  step "tools"
  command -v cargo >/dev/null || fail "cargo is missing: install Rust 1.90 or newer from https://rustup.rs"
  if ! command -v cc >/dev/null || { [ "$fuzz_seconds" != 0 ] && ! command -v c++ >/dev/null; }; then
    tests/install.sh "" gcc g++ libc6-dev
  fi
  for component in rustfmt clippy; do
    cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1 || rustup component add "$component" ||
      fail "$component is missing: rustup component add $component"
  done
  # Not installed here: to build it takes longer than it saves.
  if [ "$tier" != quick ]; then
    local needed=()
    for program in curl rsync; do command -v "$program" >/dev/null || needed+=("$program"); done
    if [ ${#needed[@]} != 0 ]; then tests/install.sh "" "${needed[@]}"; fi
  fi
  local free_gb
  mkdir -p "${CARGO_TARGET_DIR:-target}"
  free_gb=$(df -Pk "${CARGO_TARGET_DIR:-target}" | awk 'END {printf "%d", $4 / 1048576}')
  printf '%s GB of disk are free; a first run takes 8 GB\n' "$free_gb"
  if [ "$free_gb" -lt 2 ]; then
    fail "the disk is nearly full: remove target folders (cargo clean), or set CARGO_TARGET_DIR to a folder on another disk"
  fi
  case $runner in
  nextest) printf 'tests are run by cargo-nextest: %s\n' "$(cargo nextest --version | head -n 1)" ;;
  cargo) printf 'tests are run by cargo test; cargo-nextest, which is not installed, would run them side by side\n' ;;
  esac
}

check_text() {
  step "format"
  if grep -rnIE '^(<<<<<<<|>>>>>>>) ' --exclude-dir=.git --exclude-dir=target .; then
    fail "a merge was left unfinished: see above"
  fi
  find . \( -name .git -o -name target \) -prune -o \( -name '*.sh' -o -path ./.ci/run \) -print0 | xargs -0 -n 1 bash -n
  cargo fmt --all -- --check
  cargo fmt --manifest-path fuzz/Cargo.toml -- --check
  cargo fmt --manifest-path python/Cargo.toml -- --check
  cargo fmt --manifest-path web/wasm/Cargo.toml --all -- --check
  step "clippy, warnings denied"
  cargo clippy "${selection[@]}" --all-targets --quiet -- -D warnings
}

check_platforms() {
  if left_out PLATFORMS "other systems"; then return; fi
  step "Clippy for macOS and Windows"
  gently tests/platforms.sh
}

check_pure_part() {
  step "the pure part"
  tests/pure-tree.sh
}

check_documentation() {
  step "documentation, warnings denied"
  RUSTDOCFLAGS="-D warnings" gently cargo doc "${selection[@]}" --no-deps --quiet
}

fuzz() {
  if [ "$fuzz_seconds" = 0 ]; then return; fi
  step "fuzz targets, $fuzz_seconds s each"
  FUZZ_SEED=${FUZZ_SEED:-2026} gently fuzz/smoke.sh "$fuzz_seconds" >"$work/fuzz" 2>&1 || {
    tail -n 60 "$work/fuzz"
    fail "a fuzz target found something: its input is in fuzz/artifacts"
  }
  printf 'no finding\n'
}

build_firmware() {
  if left_out FIRMWARE "firmware and emulator"; then return; fi
  step "firmware"
  firmware/test.sh build || fail "firmware: see above. Where it can't be built, FIRMWARE=0 leaves it and the emulator out"
  selection[2]+=,sonard-emulator/simavr
}

build_tests() {
  step "build of the tests"
  if [ "$tier" = all ] && [ "${FAKETIME:-1}" != 0 ] && ! ls /usr/lib/*/faketime/libfaketime.so.1 >/dev/null 2>&1; then
    tests/install.sh "leave the clock that is set out with FAKETIME=0" libfaketime
  fi
  if [ "$runner" = nextest ]; then
    cargo nextest run "${selection[@]}" "${tested[@]}" --no-run --cargo-quiet
  else
    cargo test "${selection[@]}" "${tested[@]}" --no-run --quiet
  fi
}

prepare_browser() {
  if left_out PAGE "the live page"; then return; fi
  step "a browser for the live page"
  if ! command -v chromium >/dev/null || ! command -v chromedriver >/dev/null; then
    tests/install.sh "leave the page out with PAGE=0" chromium chromium-driver
  fi
  if [ "$tier" != all ]; then return; fi
  if [ "${AXE:-1}" = 0 ]; then printf 'axe-core: LEFT OUT, because AXE=0\n'; else tests/axe.sh; fi
  chromium --version
}

# The playground needs a browser to be looked at.
has_playground() { [ "${PAGE:-1}" != 0 ] && [ "${PLAYGROUND:-1}" != 0 ]; }

build_playground() {
  if ! has_playground; then
    step "the playground: LEFT OUT, because PAGE=0 or PLAYGROUND=0"
    return
  fi
  step "the playground"
  if ! command -v node >/dev/null; then tests/install.sh "leave the playground out with PLAYGROUND=0" nodejs npm; fi
  gently web/build.sh || fail "the playground: see above. Where it can't be built, PLAYGROUND=0 leaves it out"
}

smoke_page() {
  if [ "${PAGE:-1}" = 0 ]; then return; fi
  step "smoke test of the live page"
  tests/page.sh "${CARGO_TARGET_DIR:-target}/debug/sonard"
}

smoke_playground() {
  if left_out PLAYGROUND "smoke test of the playground"; then return; fi
  step "smoke test of the playground: types of its WebAssembly"
  if command -v rustup >/dev/null; then
    rustup --quiet target add wasm32-unknown-unknown || fail "no wasm32-unknown-unknown: PLAYGROUND=0 leaves the playground out"
  fi
  (cd web/wasm && CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$root/target}/wasm gently cargo check --workspace --locked --quiet)
}

develop_python() {
  if [ "${PYTHON:-1}" = 0 ]; then return; fi
  step "unoptimised build of the Python package"
  gently python/test.sh develop || fail "the Python package: see above. PYTHON=0 leaves it out"
}

# After the build of the tests: the package is compared with the program.
smoke_python() {
  if left_out PYTHON "smoke test of the Python package"; then return; fi
  step "smoke test of the Python package"
  python/test.sh smoke || fail "the Python package: see above. PYTHON=0 leaves it out"
}

check_units() {
  step "systemd units"
  systemd/test.sh
}

count_instructions() {
  if left_out INSTRUCTIONS "instruction counts"; then return; fi
  step "instruction counts"
  if ! command -v valgrind >/dev/null; then tests/install.sh "leave them out with INSTRUCTIONS=0" valgrind; fi
  local built=${CARGO_TARGET_DIR:-target}/debug
  "$built/xtask" instructions "$built/instructions" || fail "a computation takes more: see above. INSTRUCTIONS=0 leaves them out"
}

get_package_tools() {
  if [ "${PACKAGE:-0}" = 0 ]; then return; fi
  step "tools for the Debian package"
  gently packaging/test.sh tools
}

check_package() {
  case ${PACKAGE:-0} in
  1)
    step "the Debian package, around the tests' program"
    packaging/test.sh dev
    ;;
  release | all)
    step "the Debian package"
    packaging/test.sh
    ;;
  *)
    step "the Debian package: left to packaging/test.sh (PACKAGE=1 runs it here)"
    if [ "${BOOT:-1}" = 0 ]; then
      step "units under a booted systemd: LEFT OUT, because BOOT=0"
    else
      step "units under a booted systemd"
      systemd/boot-test.sh "${CARGO_TARGET_DIR:-target}/debug/sonard"
    fi
    ;;
  esac
  if [ "${PACKAGE:-0}" = all ]; then
    step "the Debian package for a Raspberry Pi"
    packaging/test.sh arm64
  fi
}

check_dist() {
  if left_out DIST "installation of a release"; then return; fi
  step "installation of a release, around the tests' program"
  local wheels=()
  if [ "${PYTHON:-1}" != 0 ]; then wheels=(python/target/wheels/*.whl); fi
  gently tests/dist.sh "${CARGO_TARGET_DIR:-target}/debug/sonard" "${wheels[@]}"
}

play_emulator() {
  if [ "${FIRMWARE:-1}" = 0 ]; then return; fi
  step "sonard on the emulated board"
  FEATURES=${selection[2]} firmware/test.sh play
}

check_examples() {
  step "examples in the documentation"
  gently cargo test "${selection[@]}" --doc --quiet
}

check_api() {
  if left_out SCHEMATHESIS "the API's document against the daemon"; then return; fi
  step "the API's document against the daemon"
  tests/schemathesis.sh "${CARGO_TARGET_DIR:-target}/debug/sonard" >"$work/api" 2>&1 || {
    tail -n 100 "$work/api"
    fail "the daemon contradicts its OpenAPI document, or the fuzzer can't be had: SCHEMATHESIS=0 leaves it out"
  }
}

build_python() {
  if left_out PYTHON "the package for Python"; then return; fi
  step "the package for Python: wheel"
  gently python/test.sh build || fail "the package for Python: see above. Where it can't be built, PYTHON=0 leaves it out"
}

test_python() {
  if [ "${PYTHON:-1}" = 0 ]; then return; fi
  step "the package for Python: types, tests"
  python/test.sh tests || fail "the package for Python: see above. PYTHON=0 leaves it out"
}

# NAME SCRIPT WHAT FAILURE: what other programs read of sonard; NAME=0 leaves it out.
check_peer() {
  if left_out "$1" "$3"; then return; fi
  step "$3"
  "tests/peers/$2" "${CARGO_TARGET_DIR:-target}/debug/sonard" || fail "$4: $1=0 leaves it out"
}

check_peers() {
  check_peer EXPORT_PEERS exports.sh "exports as other programs read them" \
    "an export differs from its log, or the readers can't be had"
  check_peer IMPORT_PEERS imports.sh "imports of what other programs write" \
    "an import or a scene differs from its file, or the formats' tools can't be had"
  check_peer FOXGLOVE_PEER foxglove.sh "live messages as Foxglove's library reads them" \
    "messages to viewers differ from the log, or the library can't be had"
  check_peer ROS_PEER ros.sh "messages as ROS 2 gets them" \
    "messages to ROS 2 differ from the log, or Cyclone DDS can't be had"
  check_peer MQTT_PEER mqtt.sh "records as mosquitto gets them" \
    "messages to a broker differ from the log, or mosquitto can't be had"
}

check_monitoring() {
  if left_out PROMTOOL "alerts as Prometheus reads them"; then return; fi
  step "alerts as Prometheus reads them"
  if ! command -v promtool >/dev/null; then tests/install.sh "leave it out with PROMTOOL=0" prometheus; fi
  tests/monitoring.sh
}

# Tests that take long, or whose subject is load: their modules and names. They run in `all` only.
long=(
  collect::interrupted daemon::chaos daemon::clock daemon::foxglove::cost daemon::kill daemon::load daemon::mqtt::rogue daemon::soak
  inverse::
  ambiguous_positions_have_wide_intervals arrivals_match_boundary_integrals bandwidth_by_time_walk position_on_a_ridge
  resumed_fit_is_bit_identical wall_roughness
)
# Prints the parts of its arguments between bars, as in a regular expression.
alternatives() { local IFS='|'; printf '%s' "$*"; }

# run_tests [ARGUMENT...]: the closing lines are kept for the end.
run_tests() {
  if [ $# = 0 ]; then set -- "${tested[@]}"; fi
  local skipped=()
  if [ "$tier" != all ]; then skipped+=("${long[@]}"); fi
  if [ "$tier" = all ]; then
    if [ "${PAGE:-1}" = 0 ]; then skipped+=(live_page:: playground::); fi
    if ! has_playground; then skipped+=(playground::); fi
  fi
  if [ "$runner" = nextest ]; then
    local filter=()
    if [ ${#skipped[@]} != 0 ]; then filter=(-E "not test(/$(alternatives "${skipped[@]}")/)"); fi
    # Half of the tests wait for a process or a clock most of their time; the configuration of nextest counts the others
    # twice.
    cargo nextest run "${selection[@]}" "$@" "${filter[@]}" --cargo-quiet --no-fail-fast \
      --test-threads $((3 * $(nproc))) --status-level slow --final-status-level fail 2>&1
  else
    local name skip=()
    # A browser takes the processors that other tests want.
    if [ "$tier" = all ]; then skipped+=(live_page:: playground::); fi
    for name in "${skipped[@]}"; do skip+=(--skip "$name"); done
    cargo test "${selection[@]}" "$@" --no-fail-fast --quiet -- "${skip[@]}" 2>&1
  fi | tee "$work/tests" | head -n "-$closing_lines"
}

# By nextest's configuration browser tests run alone.
test_page() {
  if [ "${PAGE:-1}" = 0 ] || [ "$runner" = nextest ]; then return; fi
  step "the live page"
  cargo test "${selection[@]}" --test browser --quiet live_page::
  if has_playground; then cargo test "${selection[@]}" --test browser --quiet playground::; fi
}

runner=cargo
if cargo nextest --version >/dev/null 2>&1; then runner=nextest; fi
# Examples are not run: Clippy looks at them.
tested=(--lib --bins --tests)
# The runner's summary of all tests, between empty lines.
closing_lines=3
# Packages and features: the default members with default features, or everything.
selection=()
if [ "$tier" = all ]; then
  selection=(--workspace --features sonard/full)
  # Nothing is built twice, and instruction counts hold for builds that are not incremental.
  export CARGO_INCREMENTAL=${CARGO_INCREMENTAL:-0}
fi
# A change is judged by the same random cases as the one before it.
export PROPTEST_RNG_SEED=${PROPTEST_RNG_SEED:-2026}
export SONARD_FIRMWARE=${SONARD_FIRMWARE:-$PWD/firmware/target/avr-none/release/sonard-firmware.elf}

finish() {
  local code=$1
  print_times
  tail -n "$closing_lines" "$work/tests"
  exit "$code"
}

case $tier in
quick)
  check_tools
  check_text
  step "unit tests, layers, wording"
  run_tests --lib --test layers --test wording || finish $?
  ;;
default)
  check_tools
  lane "tools of others" prepare_browser
  lane "apart from the workspace" smoke_playground develop_python
  check_text
  check_pure_part
  build_tests
  join "tools of others"
  smoke_page
  check_examples
  join "apart from the workspace"
  smoke_python
  step "tests"
  run_tests || finish $?
  ;;
all)
  check_tools
  lane "tools of others" prepare_browser get_package_tools
  lane "apart from the workspace" build_playground build_python
  build_firmware
  check_text
  check_pure_part
  build_tests
  join "tools of others"
  lane "programs of others" check_api check_peers check_monitoring play_emulator
  lane "units and package" check_units check_package count_instructions
  check_examples
  join "apart from the workspace"
  lane "release" check_dist
  test_python
  join "programs of others"
  join "units and package"
  join "release"
  # Tests, and browsers even more, leave half of the processors' time to what only computes. Fuzz targets come first:
  # the others lock the folder in which cargo looks for the tests.
  lane "other builds" fuzz check_documentation check_platforms
  test_page
  step "tests"
  run_tests || finish $?
  join "other builds"
  ;;
*) fail "quick, all or no argument, not $tier" ;;
esac
finish 0
