"""Image sources of a box-shaped room by sonard and by pyroomacoustics: agreement and computing time.

Needs ``pip install pyroomacoustics``.
"""

import time
from typing import Any

import numpy as np
import pyroomacoustics as pra
from numpy.typing import NDArray

import sonard


def by_sonard(size: list[float], place: list[float], order: int) -> tuple[NDArray[np.float64], float]:
    """Returns the image sources of a source at the position of the receiver, and the computing time in seconds."""
    width, depth, *height = size
    scene = sonard.Scene.from_points(
        [[0.0, 0.0], [width, 0.0], [width, depth], [0.0, depth]],
        reflectance=1.0,
        floor_z_m=0.0 if height else None,
        ceiling_z_m=height[0] if height else None,
    )
    # In a two-dimensional scene the ranger has no height.
    sensor = sonard.Sensor.preset("senscomp-6500")
    if height:
        sensor = sensor.replace(mounting={"z_m": place[2]})
    model = sonard.Model(scene, sensor, lossless=True, max_order=order, max_range_m=100.0)
    began = time.perf_counter()
    paths = model.paths([*place[:2], 0.0], min_amplitude=1e-6)
    took_s = time.perf_counter() - began
    walls = [path for path in paths if path.order == len(path.interactions)]
    return np.array([image(path, np.array(place)) for path in walls]), took_s


def image(path: sonard.Path, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position of an image source: at the length of the path, in the direction of its last interaction."""
    towards = path.points[-1] - place
    return np.asarray(place + path.length_m * towards / np.linalg.norm(towards))


def by_pyroomacoustics(size: list[float], place: list[float], order: int) -> tuple[NDArray[np.float64], float]:
    """Returns the image sources and the computing time in seconds, as `by_sonard` does."""
    room: Any = pra.ShoeBox(size, max_order=order, materials=pra.Material(0.0))
    room.add_source(place)
    room.add_microphone(place)
    began = time.perf_counter()
    room.image_source_model()
    took_s = time.perf_counter() - began
    source = room.sources[0]
    return np.asarray(source.images.T[source.orders > 0]), took_s


def in_order(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sorts the points, for a comparison independent of their order."""
    return points[np.lexsort(np.round(points, 6).T)]


def main() -> None:
    for size, place, order in [([4.0, 3.0], [1.1, 0.7], 20), ([4.0, 3.0, 2.5], [1.1, 0.7, 0.9], 8)]:
        ours, ours_s = by_sonard(size, place, order)
        theirs, theirs_s = by_pyroomacoustics(size, place, order)
        assert ours.shape == theirs.shape, (ours.shape, theirs.shape)
        off_m = np.abs(in_order(ours) - in_order(theirs)).max()
        assert off_m < 1e-5, off_m
        print(
            f"{len(size)} dimensions, up to {order} reflections: {len(ours)} images, equal to {off_m:.0e} m; "
            f"{ours_s * 1e3:.1f} ms by sonard, {theirs_s * 1e3:.1f} ms by pyroomacoustics, "
            f"ratio {ours_s / theirs_s:.1f}"
        )


if __name__ == "__main__":
    main()
