#!/usr/bin/env bash
# Makes the pictures of the documentation. Run it after a change that may change them, and look at
# them.
#
#   docs/make-pictures.sh            all of them
#   SONARD=path/to/sonard SONARD_PAPERS=path/to/sonard-papers docs/make-pictures.sh    with built programs
set -euo pipefail
cd "$(dirname "$0")/.."
if [ -z "${SONARD:-}" ]; then
  cargo build --release --quiet
  SONARD=target/release/sonard
fi
if [ -z "${SONARD_PAPERS:-}" ]; then
  cargo build --release --quiet --package sonard-papers
  SONARD_PAPERS=target/release/sonard-papers
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
pictures=docs/pictures
for pose in fig7 fig9; do
  "$SONARD" scan --mock --scene simple-room --pose "$pose" --seed 1 --out "$work/$pose" 2>/dev/null
  "$SONARD" plot "$work/$pose/scan.jsonl" -o "$pictures/simple-room-$pose.png" --width 1200
done

# The phenomena of Dudek, Jenkin, Milios and Wilkes, by engine (docs/engines.md).
while read -r scene pose step; do
  for engine in paths fan cone; do
    "$SONARD" simulate --scene "$scene" --pose "$pose" --step-deg "$step" --engine "$engine"
  done >"$work/engines.jsonl"
  "$SONARD" plot "$work/engines.jsonl" --kind side-by-side -o "$pictures/engines-$scene-$pose.png"
done <<'EOF'
simple-room fig7 1.8
simple-room fig9 1.8
simple-room-robot fig9 1.8
mcgill-lab fig4 5
oblique-corner robot 3
right-angle-corner robot 3
two-surface-room middle 1.8
corridor beside-wall 1.8
EOF

# How the fan of rays comes closer to the exact paths.
cargo run --release --quiet --example fan_convergence -- "$pictures/fan-convergence.png"

# Figure 2's echo traces, and the path to the false lower wall of figure 9.
for pose in a b c d; do
  "$SONARD" trace --scene echo-traces --pose "$pose" --until 3 -o "$pictures/echo-trace-$pose.png"
done
"$SONARD" simulate --scene simple-room --pose fig9 -o "$work/fig9.jsonl"
"$SONARD" plot "$work/fig9.jsonl" --azimuth-deg 270 -o "$pictures/simple-room-fig9-path.png"

# One room explored in three ways.
"$SONARD_PAPERS" benchmark explore --rooms 2 --out "$work/rooms" >/dev/null
cp "$work/rooms/room-2/maps.png" "$pictures/explored.png"

# Eight sonars of a Pioneer 3-DX.
"$SONARD" simulate --array pioneer-8 --scene mcgill-lab --pose fig4 -o "$work/array.jsonl"
"$SONARD" plot "$work/array.jsonl" -o "$pictures/array-mcgill-lab.png"

# A recording as Rerun's viewer shows it.
tests/install.sh "" xvfb xauth mesa-vulkan-drivers
tests/venv.sh target/tools/rerun "" rerun-sdk==0.41.0
"$SONARD" export "$work/fig9/scan.jsonl" -o "$work/fig9.mcap" 2>/dev/null
# On a screen so large that its pointer is not over the window.
xvfb-run --auto-servernum --server-args "-screen 0 2600x1600x24" \
  target/tools/rerun/bin/python docs/recording_picture.py "$work/fig9.mcap" "$pictures/recording.png" 2>/dev/null

# A daemon as Prometheus shows it.
tests/install.sh "" prometheus chromium
docs/monitoring-picture.sh "$SONARD" "$pictures/prometheus.png"
# A live scan as Foxglove Studio shows it; from npm, under the MPL 2.0 and no part of this repository.
command -v npm >/dev/null || tests/install.sh "" nodejs npm
mkdir -p target/tools/studio
cp docs/studio/* target/tools/studio/
npm ci --silent --no-fund --no-audit --prefix target/tools/studio
node target/tools/studio/picture.mjs "$SONARD" config/foxglove-layout.json "$pictures/foxglove.png"

# The live page, as its test sees it in Chromium.
tests/axe.sh
cargo test --quiet -p sonard-browser-tests live_page::accessible
cargo test --quiet -p sonard-browser-tests live_page::pictures
cargo test --quiet -p sonard-browser-tests live_page::fleet
cp target/page/desk.png "$pictures/page-desk.png"
cp target/page/phone-dark.png "$pictures/page-phone.png"
cp target/page/fleet-desk.png "$pictures/fleet.png"
cp target/page/page-{overlays,preview}.png "$pictures/"

# The playground, likewise.
web/build.sh
cargo test --quiet -p sonard-browser-tests playground::pictures
cargo test --quiet -p sonard-browser-tests playground::hidden_room
for picture in desk phone engines; do cp "target/page/playground-$picture.png" "$pictures/"; done
cp target/page/playground.png target/page/hidden-room.png "$pictures/"
ls -l "$pictures"
