#!/usr/bin/env bash
# Builds the package for Python as a wheel, and holds it: lints, stubtest, types, tests. In an
# environment of its own under target/, made anew when what it needs has changed.
#
#   python/test.sh                          with the python3 on the path
#   PYTHON_INTERPRETERS="python3.10 python3.13" python/test.sh   run the tests with each of these, too
#
# The command `sonard` that readings are compared with is taken from the repository's target/debug; if there is
# none, it is built.
set -euo pipefail
cd "$(dirname "$0")"
root=$(cd .. && pwd)
export SONARD=${SONARD:-${CARGO_TARGET_DIR:-$root/target}/debug/sonard}
# What is built here is of no use to the workspace, and the other way round.
export CARGO_TARGET_DIR=$PWD/target
needed=(maturin mypy numpy pytest hypothesis matplotlib pyroomacoustics pyarrow scikit-learn mujoco shapely)

[ -x "$SONARD" ] || (cd .. && unset CARGO_TARGET_DIR && cargo build --workspace --quiet)
../tests/venv.sh target/venv PYTHON=0 "${needed[@]}"

rm -rf target/wheels
target/venv/bin/maturin build --release --locked --quiet --interpreter target/venv/bin/python
wheel=$(ls target/wheels/*.whl)
target/venv/bin/pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
ls -lh "$wheel" | awk '{print "wheel: " $5}'
cargo clippy --release --locked --quiet -- -D warnings

# Not from this folder, whose package has no compiled part.
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tool() { (cd "$work" && "$OLDPWD/target/venv/bin/$1" "${@:2}"); }
tool python -m mypy.stubtest --mypy-config-file "$PWD/pyproject.toml" sonard
tool python -m mypy --config-file "$PWD/pyproject.toml" --cache-dir "$work/mypy" \
  "$PWD/package" "$PWD/tests" "$PWD/gallery"
target/venv/bin/pytest --durations=5 -rs
for interpreter in ${PYTHON_INTERPRETERS:-}; do
  folder=target/venv-$(basename "$interpreter")
  INTERPRETER=$interpreter ../tests/venv.sh "$folder" PYTHON=0 numpy pytest hypothesis matplotlib
  "$folder/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
  "$folder/bin/python" --version
  "$folder/bin/pytest"
done
