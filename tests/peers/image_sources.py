#!/usr/bin/env python3
"""Writes tests/data/peers/image_sources.json: visible image sources by pyroomacoustics.

    pip install pyroomacoustics==0.8.*      # tried with 0.8.4 and numpy 2
    python3 tests/peers/image_sources.py

200 random simple polygons with 4 to 8 corners, convex and not, rigid walls; source and
microphone at one place inside, reflections up to order 6. Conventions: an image counts if the
microphone sees it through all its walls (`room.visibility`); the source itself (order 0) is left
out; a sequence of walls and its reverse are two images. pyroomacoustics computes in single
precision, so images whose path passes within MARGIN_M of a corner are a matter of rounding
there: places with such an image are drawn again.
"""

import json
import math
import pathlib
import random

import numpy as np
import pyroomacoustics as pra

ORDER = 6
POLYGONS = 200
MARGIN_M = 2e-4


def polygon(rng):
    """Corners counter-clockwise; simple because their directions from the middle increase."""
    count = rng.randint(4, 8)
    while True:
        angles = sorted(rng.uniform(0, 2 * math.pi) for _ in range(count))
        gaps = [(b - a) % (2 * math.pi) for a, b in zip(angles, angles[1:] + angles[:1])]
        if min(gaps) > 0.25 and max(gaps) < 2.6:
            break
    radii = [rng.uniform(1.0, 4.0) for _ in angles]
    return [[round(r * math.cos(a), 4), round(r * math.sin(a), 4)] for r, a in zip(radii, angles)]


def inside(corners, x, y):
    odd = False
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1]):
        if (ay > y) != (by > y) and x < (bx - ax) * (y - ay) / (by - ay) + ax:
            odd = not odd
    return odd


def distance(corners, x, y):
    """From the nearest wall."""
    def to_wall(a, b):
        along = (b[0] - a[0], b[1] - a[1])
        part = ((x - a[0]) * along[0] + (y - a[1]) * along[1]) / (along[0] ** 2 + along[1] ** 2)
        part = min(1.0, max(0.0, part))
        return math.hypot(x - a[0] - part * along[0], y - a[1] - part * along[1])

    return min(to_wall(a, b) for a, b in zip(corners, corners[1:] + corners[:1]))


def visible_images(corners, at):
    room = pra.Room.from_corners(np.array(corners).T, fs=16000, max_order=ORDER,
                                 materials=pra.Material(0.0))
    room.add_source(at)
    room.add_microphone(at)
    room.image_source_model()
    seen = room.visibility[0][0].astype(bool)
    images = room.sources[0].images.T
    orders = room.sources[0].orders
    return sorted([int(o), *(float(v) for v in p)]
                  for o, p, s in zip(orders, images, seen) if s and o > 0)


def is_sharp(corners, at):
    """Whether nothing changes for neighbours of the place: no image at the brink of sight."""
    def count(x, y):
        return len(visible_images(corners, [x, y]))

    here = count(*at)
    steps = [(MARGIN_M, 0), (-MARGIN_M, 0), (0, MARGIN_M), (0, -MARGIN_M)]
    return all(count(at[0] + dx, at[1] + dy) == here for dx, dy in steps)


def main():
    rng = random.Random(20)
    cases = []
    while len(cases) < POLYGONS:
        corners = polygon(rng)
        x, y = round(rng.uniform(-4, 4), 4), round(rng.uniform(-4, 4), 4)
        if not inside(corners, x, y) or distance(corners, x, y) < 0.05:
            continue
        if not is_sharp(corners, [x, y]):
            continue
        images = [[o, round(px, 5), round(py, 5)] for o, px, py in visible_images(corners, [x, y])]
        cases.append({"corners": corners, "at": [x, y], "images": images})
    out = pathlib.Path(__file__).parents[1] / "data" / "peers" / "image_sources.json"
    lines = ",\n".join(json.dumps(case, separators=(",", ":")) for case in cases)
    out.write_text(f'{{"pyroomacoustics":"{pra.__version__}","order":{ORDER},"cases":[\n{lines}\n]}}\n')


if __name__ == "__main__":
    main()
