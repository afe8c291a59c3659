#!/usr/bin/env bash
# Has programs of others read what `sonard export` writes, and holds every field against the logs (exports.py, with
# recordings.py and tables.py; tools from PyPI, in an environment of their own under target/tools).
#
#   tests/peers/exports.sh [PROGRAM]    without a program, it is built
set -euo pipefail
cd "$(dirname "$0")/../.."
packages=(mcap==1.6.0 mcap-ros2-support==0.6.0 rosbags==0.11.9 duckdb==2.0.0 pyarrow==26.0.1 numpy==2.4.6
  shapely==2.2.0 pyogrio==0.13.0)
target=${CARGO_TARGET_DIR:-target}
tools=$target/tools/exports
tests/venv.sh "$tools" EXPORT_PEERS=0 "${packages[@]}"
program=$(realpath "${1:-$target/debug/sonard}")
if [ $# = 0 ]; then cargo build --quiet --features full; fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
made() { "$program" "$@" 2>"$work/output" >/dev/null || { cat "$work/output" >&2; exit 1; }; }
# Simulated, without times, also on a course and of an array; of a mock in virtual time by ticks, and in real time by
# its clock.
made simulate --scene simple-room --pose fig9 -o "$work/simulated.jsonl"
printf 'x_m,y_m,heading_deg\n2,1.5,0\n2.6,1.5,0\n3.2,1.6,30\n' >"$work/course"
made simulate --scene mcgill-lab --poses "$work/course" --max-range 5 -o "$work/course.jsonl"
made simulate --array pioneer-8 --scene mcgill-lab --poses "$work/course" -o "$work/array.jsonl"
sed 's/40\.0/12.0/' arrays/pioneer-8.json >"$work/hasty.json"
made simulate --array "$work/hasty.json" --scene mcgill-lab --poses "$work/course" -o "$work/crosstalk.jsonl"
grep -q '"crosstalk"' "$work/crosstalk.jsonl"
made scan --mock --scene simple-room --pose fig7 --max-range 4 --repeat 2 --out "$work/mock"
mv "$work/mock/scan.jsonl" "$work/mock.jsonl"
made scan --mock --realtime --scene simple-room --pose fig9 --to-deg 36 --max-range 2 --out "$work/clock"
mv "$work/clock/scan.jsonl" "$work/clock.jsonl"
for log in "$work"/*.jsonl; do
  made export "$log" -o "${log%.jsonl}-rep117.mcap"
  made export "$log" --profile nav2 -o "${log%.jsonl}-nav2.mcap"
  made export "$log" -o "${log%.jsonl}.csv"
  made export "$log" -o "${log%.jsonl}.parquet"
done
# What was found of a place.
mkdir "$work/places"
"$program" lines "$work/simulated.jsonl" --json -o "$work/places/lines.geojson" -o "$work/places/lines.mcap" \
  >"$work/places/lines.jsonl"
"$program" interpret "$work/simulated.jsonl" --json -o "$work/places/features.geojson" -o "$work/places/features.mcap" \
  >"$work/places/features.jsonl"
made map "$work/simulated.jsonl" --out "$work/places/map"
# A bag of another robot, as rosbags writes it, in both of rosbag2's storages, and with chunks packed by Zstandard.
"$tools/bin/python" tests/peers/bag.py "$work/bag"
for bag in bag bag-zstd bag-sqlite; do
  "$program" import "$work/$bag" -o "$work/places/$bag.jsonl"
done
"$tools/bin/rosbags-convert" --src "$work/bag-sqlite" --dst "$work/bag-converted" --dst-storage mcap --dst-typestore ros2_jazzy
"$program" import "$work/bag-converted" -o "$work/places/bag-converted.jsonl"
"$tools/bin/python" tests/peers/exports.py "$work"
