"""Runs every script of the gallery and every example of the documentation."""

import doctest
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import sonard

from .conftest import PROGRAM, REPOSITORY

GALLERY = REPOSITORY / "python/gallery"
SCRIPTS = sorted(GALLERY.glob("*.py"))


def options(script: Path, folder: Path) -> list[str]:
    """Reduced data set, sufficient to run the script; GALLERY=full generates the documented one."""
    spec = script.with_suffix(".toml")
    if os.environ.get("GALLERY") == "full" or not spec.exists():
        return []
    small = re.sub("^scenes = .*$", "scenes = 2", spec.read_text(), flags=re.MULTILINE)
    (folder / "small.toml").write_text(re.sub("^poses = .*$", "poses = 5", small, flags=re.MULTILINE))
    return ["small.toml"]


def run(program: list[str], folder: Path) -> str:
    environment = {**os.environ, "MPLCONFIGDIR": str(folder / ".matplotlib"), "SONARD": PROGRAM}
    done = subprocess.run(
        [sys.executable, "-W", "error", *program], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_gallery_scripts(script: Path, tmp_path: Path) -> None:
    needs = set(re.findall(r"^import (\w+)", script.read_text(), re.MULTILINE))
    lacking = [name for name in needs if find_spec(name) is None]
    if lacking:
        pytest.skip(f"{lacking} is not installed here")
    output = run([str(script), *options(script, tmp_path)], tmp_path)
    assert output.strip()
    print(output)
    if "savefig" in script.read_text() and find_spec("matplotlib"):
        assert (tmp_path / f"{script.stem}.png").stat().st_size > 10_000


@pytest.mark.parametrize("page", ["python/README.md", "docs/python.md"])
def test_documentation_examples(page: str, tmp_path: Path) -> None:
    text = (REPOSITORY / page).read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert blocks
    program = "\n".join(blocks)
    if "matplotlib" in program and not find_spec("matplotlib"):
        pytest.skip("matplotlib is not installed here")
    output = run(["-c", program], tmp_path)
    expected = re.findall(r"^# (<.*)$", program, re.MULTILINE)
    assert [line for line in output.splitlines() if line.startswith("<")] == expected


def test_module_docstring() -> None:
    failed, tried = doctest.testmod(sonard)
    assert (failed, tried > 4) == (0, True)
