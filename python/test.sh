#!/usr/bin/env bash
# Builds the package for Python as a wheel, and holds it: lints, stubtest, types, tests. In an
# environment of its own under target/, made anew when what it needs has changed.
#
#   python/test.sh                          with the python3 on the path
#   python/test.sh build                    the wheel alone, which needs no command `sonard`; tests/platforms.sh has lints
#   python/test.sh tests                    the rest, with the wheel that was built
#   python/test.sh develop                  an unoptimised build, which needs no command `sonard`
#   python/test.sh smoke                    the same, and the tests of the model
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

build_wheel() {
  rm -rf target/wheels
  target/venv/bin/maturin build --release --locked --quiet --interpreter target/venv/bin/python
  ls -lh target/wheels/*.whl | awk '{print "wheel: " $5}'
}

lint() { cargo clippy --release --locked --quiet -- -D warnings; }

# install FOLDER: the wheel into an environment.
install_wheel() {
  "$1/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps target/wheels/*.whl
}

# Not from this folder, whose package has no compiled part.
tool() { (cd "$work" && "$OLDPWD/target/venv/bin/$1" "${@:2}"); }

run_tests() {
  [ -x "$SONARD" ] || (cd .. && unset CARGO_TARGET_DIR && cargo build --quiet)
  install_wheel target/venv
  tool python -m mypy.stubtest --mypy-config-file "$PWD/pyproject.toml" sonard
  tool python -m mypy --config-file "$PWD/pyproject.toml" --cache-dir "$work/mypy" \
    "$PWD/package" "$PWD/tests" "$PWD/gallery"
  target/venv/bin/pytest --durations=5 -rs
  local interpreter folder
  for interpreter in ${PYTHON_INTERPRETERS:-}; do
    folder=target/venv-$(basename "$interpreter")
    INTERPRETER=$interpreter ../tests/venv.sh "$folder" PYTHON=0 numpy pytest hypothesis matplotlib
    install_wheel "$folder"
    "$folder/bin/python" --version
    "$folder/bin/pytest"
  done
}

develop() {
  VIRTUAL_ENV=$PWD/target/venv-smoke target/venv-smoke/bin/maturin develop --locked --quiet
}

smoke() {
  develop
  target/venv-smoke/bin/pytest --quiet tests/test_model.py
}

case ${1:-} in
develop | smoke) needed=(maturin numpy pytest hypothesis) venv=target/venv-smoke ;;
*) venv=target/venv ;;
esac
../tests/venv.sh "$venv" PYTHON=0 "${needed[@]}"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
case ${1:-} in
"")
  build_wheel
  lint
  run_tests
  ;;
build) build_wheel ;;
tests) run_tests ;;
develop) develop ;;
smoke) smoke ;;
*)
  echo "python/test.sh: all (no argument), build, tests, develop or smoke, not $1" >&2
  exit 1
  ;;
esac
