"""Scenes from shapes of other packages and from maps."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sonard

from .conftest import Command

HALL = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]
DESK = [(1.0, 1.0), (1.5, 1.0), (1.5, 1.4), (1.0, 1.4)]


def closed(corners: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [*corners, corners[0]]


def polygon(*rings: list[tuple[float, float]]) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [closed(ring) for ring in rings]}


def test_polygon_with_hole() -> None:
    scene = sonard.Scene.from_shapes(polygon(HALL, DESK))
    expected = sonard.Scene.from_points(HALL, obstacles=[DESK])
    np.testing.assert_array_equal(scene.walls, expected.walls)
    assert scene.wall_ids[0] == "polygon-0.0" and scene.wall_ids[4] == "polygon-0-hole-0.0"
    places = [[0.5, 0.5], [1.2, 1.2], [5.0, 1.0]]
    assert scene.are_accessible(places).tolist() == expected.are_accessible(places).tolist() == [True, False, False]
    pose = [0.5, 0.5, 0.0]
    assert sonard.Model(scene).predict(pose).tobytes() == sonard.Model(expected).predict(pose).tobytes()


class Geo:
    """Object with ``__geo_interface__`` only."""

    def __init__(self, geo: dict[str, Any]) -> None:
        self.__geo_interface__ = geo


class Coords:
    """Object with ``coords`` only."""

    def __init__(self, coords: Any) -> None:
        self.coords = coords


def test_equivalent_line_inputs() -> None:
    line = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)]
    expected = sonard.Scene.from_points(line, closed=False).walls
    geo = {"type": "LineString", "coordinates": line}
    feature = {"type": "Feature", "properties": {}, "geometry": geo}
    nothing: dict[str, Any] = {"type": "Feature", "properties": {}, "geometry": None}
    for shapes in [
        geo,
        Geo(geo),
        [Geo(geo)],
        Coords(line),
        Coords(iter(line)),
        Coords(np.column_stack([line, np.ones(3)])),
        Coords([line[0], *line]),
        feature,
        {"type": "FeatureCollection", "features": [nothing, feature]},
        {"type": "MultiLineString", "coordinates": [line, []]},
        [[], [{"type": "GeometryCollection", "geometries": [Geo(feature)]}]],
        ({"type": "MultiLineString", "coordinates": [pair]} for pair in [line]),
    ]:
        np.testing.assert_array_equal(sonard.Scene.from_shapes(shapes).walls, expected)
    ring = sonard.Scene.from_shapes(Coords(closed(HALL)), cylinders=[[3, 2, 0.1]], floor_z_m=0, ceiling_z_m=2)
    assert len(ring.walls) == 4 and len(ring.cylinders) == 1 and ring.ceiling_z_m == 2
    many = sonard.Scene.from_shapes({"type": "MultiPolygon", "coordinates": [[closed(HALL)], [closed(DESK)]]}, name="both")
    assert many.name == "both" and len(many.walls) == 8 and many.wall_ids[4] == "polygon-1.0"


def test_shapely_matches_points() -> None:
    shapely = pytest.importorskip("shapely")
    room = shapely.Polygon(HALL, [DESK])
    np.testing.assert_array_equal(sonard.Scene.from_shapes(room).walls, sonard.Scene.from_shapes(polygon(HALL, DESK)).walls)
    desk = shapely.Polygon(DESK)
    column = shapely.Point(3, 2).buffer(0.2)
    board = shapely.LineString([(2.0, 0.5, 1.0), (2.5, 0.5, 1.0)])
    scene = sonard.Scene.from_shapes([shapely.Polygon(HALL), shapely.MultiPolygon([desk, column]), board])
    assert len(scene.walls) == 4 + 4 + (len(column.exterior.coords) - 1) + 1
    rng = np.random.default_rng(5)
    places = rng.uniform(-1, 5, (500, 2))
    inside = shapely.contains_xy(room.difference(column), *places.T)
    near = shapely.distance(shapely.points(places), shapely.union_all([room.boundary, column.boundary, board])) < 2e-3
    agree = scene.are_accessible(places) == inside
    assert (agree | near).all() and inside.sum() > 100
    for empty in [shapely.Polygon(), shapely.GeometryCollection(), []]:
        with pytest.raises(ValueError, match="shapes contain no line"):
            sonard.Scene.from_shapes(empty)
    with pytest.raises(ValueError, match=r"shapes\[1\] is a Point, which has no wall: pass its buffer"):
        sonard.Scene.from_shapes([room, shapely.Point(1, 1)])


@settings(max_examples=50, deadline=None)
@given(
    sizes=st.lists(st.floats(0.3, 1.5), min_size=3, max_size=9),
    turn=st.floats(0, 6.28),
    holes=st.integers(0, 2),
)
def test_shapely_keeps_corners(sizes: list[float], turn: float, holes: int) -> None:
    shapely = pytest.importorskip("shapely")
    angles = turn + np.linspace(0, 2 * np.pi, len(sizes), endpoint=False)
    outer = np.column_stack([np.cos(angles), np.sin(angles)]) * np.array(sizes)[:, None]
    inner = [outer * share for share in (0.4, 0.2)[:holes]]
    star = shapely.Polygon(outer, inner)
    scene = sonard.Scene.from_shapes(star)
    np.testing.assert_array_equal(scene.walls[:, 0], np.concatenate([outer, *inner]))


class Endless:
    """Iterable that contains itself."""

    def __iter__(self) -> Iterator[Any]:
        yield self


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda: 3, TypeError, "shapes is a <class 'int'>: must be shapes"),
        (lambda: "POLYGON ((0 0, 1 0, 1 1))", TypeError, "shapes is a <class 'str'>"),
        (lambda: [HALL], TypeError, "shapes[0][0][0] is a <class 'float'>"),
        (lambda: {"coordinates": []}, ValueError, "without a type"),
        (lambda: {"type": "Curve"}, ValueError, "`Curve`, which has no outline"),
        (lambda: {"type": "LineString"}, KeyError, "coordinates"),
        (lambda: {"type": "MultiPoint", "coordinates": HALL}, ValueError, "MultiPoint"),
        (lambda: Coords([[1.0], [2.0]]), ValueError, "shape [2, 1]"),
        (lambda: Coords([[1.0, 2.0], [2.0]]), ValueError, "inhomogeneous"),
        (lambda: Coords([[0.0, 0.0], [np.nan, 1.0]]), sonard.SceneError, "walls[0]"),
        (lambda: Coords([[1.0, 1.0], [1.0, 1.0]]), sonard.SceneError, "walls[0]"),
        (lambda: Endless(), ValueError, "more than 32 deep"),
    ],
)
def test_invalid_shapes(make: Callable[[], Any], kind: type[Exception], words: str) -> None:
    with pytest.raises(kind) as caught:
        sonard.Scene.from_shapes(make())
    assert words in str(caught.value)


def write_map(folder: Path, pixels: np.ndarray[Any, np.dtype[np.uint8]]) -> Path:
    """Writes a map with cells of 5 cm."""
    folder.mkdir()
    rows, columns = pixels.shape
    (folder / "map.pgm").write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + pixels.tobytes())
    (folder / "map.yaml").write_text(
        "image: map.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return folder


def test_map_matches_command(command: Command, tmp_path: Path) -> None:
    pixels = np.full((60, 80), 254, np.uint8)
    pixels[[0, 1, -2, -1]] = pixels[:, [0, 1, -2, -1]] = 0
    pixels[20:30, 30:50] = 0
    pixels[40:45, 10:15] = 205
    folder = write_map(tmp_path / "office", pixels)
    ways: list[dict[str, Any]] = [{}, {"tolerance_m": 0.2, "min_length_m": 3.0, "reflectance": 0.5, "name": "mine"}]
    named = {"min_length_m": "min-length-m"}
    for options in ways:
        flags = {f"--{named.get(name, name.replace('_', '-'))}": value for name, value in options.items()}
        arguments = [part for flag in flags.items() for part in flag]
        command("scene", "from-grid", folder, *arguments, "-o", tmp_path / "scene.json", "--force")
        expected = (tmp_path / "scene.json").read_text()
        assert sonard.Scene.from_grid(folder, **options).to_json() == expected
        assert sonard.Scene.from_grid(str(folder / "map.yaml"), **{"name": "office", **options}).to_json() == expected
    scene = sonard.Scene.from_grid(folder)
    assert scene.name == "office" and scene.are_accessible([[0.0, 3.0], [1.0, 3.75]]).tolist() == [True, False]


def test_invalid_maps(tmp_path: Path) -> None:
    folder = write_map(tmp_path / "empty", np.full((20, 20), 254, np.uint8))
    with pytest.raises(sonard.SceneError, match="the map contains no wall") as caught:
        sonard.Scene.from_grid(folder)
    assert "occupied cells" in caught.value.help
    with pytest.raises(ValueError, match="min_length_m is -1"):
        sonard.Scene.from_grid(folder, min_length_m=-1)
    (folder / "map.pgm").write_bytes(b"P5\n20 20\n255\n..")
    with pytest.raises(sonard.SceneError, match="map.pgm: byte 2: the image ends before"):
        sonard.Scene.from_grid(folder)
    (folder / "map.pgm").write_bytes(b"\x89PNG....")
    with pytest.raises(sonard.SceneError, match="PNG"):
        sonard.Scene.from_grid(folder)
    (folder / "map.pgm").unlink()
    with pytest.raises(FileNotFoundError) as missing:
        sonard.Scene.from_grid(folder)
    assert missing.value.filename == str(folder / "map.pgm")
    with pytest.raises(FileNotFoundError):
        sonard.Scene.from_grid(tmp_path / "nowhere")
