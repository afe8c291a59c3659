# Sourced, in the root of this repository: makes sure of Foxglove's own client library (from npm, under target/tools; no part of
# this repository) with foxglove.mjs beside it, where node finds it; sets foxglove_tools to the folder.
foxglove_packages=(@foxglove/ws-protocol@0.8.0 @foxglove/rosmsg@5.0.5 @foxglove/rosmsg2-serialization@3.1.0 ws@8.18.3)
foxglove_tools=${CARGO_TARGET_DIR:-target}/tools/foxglove
if [ "$(cat "$foxglove_tools/packages" 2>/dev/null)" != "${foxglove_packages[*]}" ]; then
  command -v npm >/dev/null || tests/install.sh "leave viewers out with FOXGLOVE_PEER=0" nodejs npm
  mkdir -p "$foxglove_tools"
  npm install --silent --no-fund --no-audit --no-save --prefix "$foxglove_tools" "${foxglove_packages[@]}"
  echo "${foxglove_packages[*]}" >"$foxglove_tools/packages"
fi
cp tests/peers/foxglove.mjs "$foxglove_tools/"
