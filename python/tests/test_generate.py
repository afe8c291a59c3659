"""Data sets compared with those of the command."""

import subprocess
from pathlib import Path

import pytest

import sonard

from .conftest import PROGRAM

SPEC = """
[set]
name = "test rooms"
shards = 4
scenes = 1
poses = 3
[[scene]]
shape = "rectangle"
width_m = [3, 5]
depth_m = 3
[model]
max_range_m = 3
[keep]
features = true
"""


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_parts_match_command(tmp_path: Path) -> None:
    spec = tmp_path / "spec.toml"
    spec.write_text(SPEC)
    subprocess.run([PROGRAM, "generate", spec, "--out", tmp_path / "command", "--shard", "1/1"], check=True)
    made = sonard.generate(spec, tmp_path / "set", part=(2, 3), threads=1)
    assert made == {"generated": 1, "existed": 0, "sha256": None, "readings": None, "bytes": None}
    made = sonard.generate(str(spec), tmp_path / "set")
    assert (made["generated"], made["existed"], made["readings"]) == (3, 1, 4 * 3 * 400)
    assert files(tmp_path / "set") == files(tmp_path / "command")


def test_error_messages(tmp_path: Path) -> None:
    spec = tmp_path / "spec.toml"
    spec.write_text(SPEC.replace("poses = 3", "pose = 3"))
    with pytest.raises(sonard.SonardError, match=r"spec.toml:6:1: set.pose: unknown field `pose`") as raised:
        sonard.generate(spec, tmp_path / "set")
    assert "poses" in raised.value.help
    with pytest.raises(sonard.SonardError, match="no part 5 of 4"):
        sonard.generate(spec, tmp_path / "set", part=(5, 4))
    with pytest.raises(FileNotFoundError):
        sonard.generate(tmp_path / "none.toml", tmp_path / "set")
