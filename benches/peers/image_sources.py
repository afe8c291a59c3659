#!/usr/bin/env python3
"""Compares image sources of sonard and pyroomacoustics: times as ratios of one run, and agreement.

    pip install ./python pyroomacoustics numpy
    python3 benches/peers/image_sources.py               # 100 polygons; some minutes
    python3 benches/peers/image_sources.py --polygons 1000 --hall-order 7

Rooms: a box to order 20; the hall of pyroomacoustics' issue 383, which takes it minutes at order
10, so both run at --hall-order and sonard alone at 10; the L-room of benches/src/paths.rs to order
8; random polygons to order 6. Images that only one of both finds are listed as degenerate if their
path passes within DEGENERATE_M of a corner, where single precision decides. The exit code is 1 if
one does not.
"""

import argparse
import math
import random
import statistics
import sys
import time

import numpy as np
import pyroomacoustics as pra

import sonard

BOX_M = (5.0, 4.0, 3.0)
HALL = [[0, 0], [1, 0], [1, 1], [2, 1], [2, 0], [3, 0], [3, 5], [2, 5], [2, 2], [1, 2], [1, 5], [0, 5]]
HALL_HEIGHT_M = 3.0
L_ROOM = [[0, 0], [4, 0], [4, 2], [2.5, 2], [2.5, 5], [0, 5]]
DEGENERATE_M = 1e-3
SAME_M = 2e-3


def timed(run, repeats):
    """Median time of some runs, and the last result."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        result = run()
        times.append(time.perf_counter() - begin)
    return statistics.median(times), result


def theirs(room, source, receiver):
    """Image sources of a room of pyroomacoustics that the receiver sees."""
    room.add_source(source)
    room.add_microphone(receiver)
    begin = time.perf_counter()
    room.image_source_model()
    took_s = time.perf_counter() - begin
    seen = room.visibility[0][0].astype(bool)
    return took_s, room.sources[0], seen


def polygon_room(corners, order, height_m=None):
    room = pra.Room.from_corners(np.array(corners, dtype=float).T, fs=16000, max_order=order,
                                 materials=pra.Material(0.0))
    if height_m is not None:
        room.extrude(height_m, materials=pra.Material(0.0))
    return room


def places(source, seen):
    """Number of different images: both sequences of a right-angled corner have one."""
    images = source.images[:, seen].T
    kept = []
    for image in images:
        if all(np.linalg.norm(image - other) > SAME_M for other in kept):
            kept.append(image)
    return len(kept)


def report(name, ours_s, theirs_s, counts):
    ratio = ours_s / theirs_s
    text = f"{ratio:.2f} times as long" if ratio > 1 else f"{1 / ratio:.1f} times faster"
    print(f"{name}: sonard {1e3 * ours_s:.3f} ms, pyroomacoustics {1e3 * theirs_s:.3f} ms: {text}; "
          f"{counts[0]} and {counts[1]} images", flush=True)


def box(repeats):
    source, receiver = [1.1, 0.7, 1.2], [3.2, 2.9, 1.7]
    ours_s, found = timed(lambda: sonard.image_sources(BOX_M, source, receiver, 20, reflectance=1.0), repeats)

    def run():
        room = pra.ShoeBox(BOX_M, fs=16000, max_order=20, materials=pra.Material(0.0))
        return theirs(room, source, receiver)

    runs = [run() for _ in range(repeats)]
    report("box, order 20", ours_s, statistics.median(r[0] for r in runs), (len(found), int(runs[-1][2].sum())))


def hall(order):
    source, receiver = [1.5, 1.5, 1.5], [0.5, 4.0, 1.2]
    scene = sonard.Scene.from_points(HALL, reflectance=1.0, floor_z_m=0.0, ceiling_z_m=HALL_HEIGHT_M)
    ours_s, found = timed(lambda: sonard.image_sources(scene, source, receiver, order), 3)
    theirs_s, source_list, seen = theirs(polygon_room(HALL, order, HALL_HEIGHT_M), source, receiver)
    report(f"hall of issue 383, order {order}", ours_s, theirs_s, (len(found), places(source_list, seen)))
    ours_s, found = timed(lambda: sonard.image_sources(scene, source, receiver, 10), 3)
    print(f"hall of issue 383, order 10: sonard {1e3 * ours_s:.1f} ms; {len(found)} images", flush=True)


def l_room(repeats):
    at = [1.13, 0.87]
    scene = sonard.Scene.from_points(L_ROOM, reflectance=1.0)
    ours_s, found = timed(lambda: sonard.image_sources(scene, at, at, 8), 10 * repeats)
    runs = [theirs(polygon_room(L_ROOM, 8), at, at) for _ in range(repeats)]
    # Without the source itself, which a receiver at the same place does not list.
    report("L-room, order 8", ours_s, statistics.median(r[0] for r in runs),
           (len(found), places(*runs[-1][1:]) - 1))


def random_polygon(rng):
    """Corners counter-clockwise, whose directions from the middle increase, and two places inside."""
    count = rng.randint(4, 8)
    while True:
        angles = sorted(rng.uniform(0, 2 * math.pi) for _ in range(count))
        gaps = [(b - a) % (2 * math.pi) for a, b in zip(angles, angles[1:] + angles[:1])]
        if min(gaps) > 0.25 and max(gaps) < 2.6:
            break
    radii = [rng.uniform(1.0, 4.0) for _ in angles]
    corners = [[r * math.cos(a), r * math.sin(a)] for r, a in zip(radii, angles)]
    places = []
    while len(places) < 2:
        x, y = rng.uniform(-4, 4), rng.uniform(-4, 4)
        if inside(corners, x, y):
            places.append([x, y])
    return corners, places


def inside(corners, x, y):
    """Whether a place is in a polygon and 5 cm off its walls."""
    odd = False
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1]):
        if (ay > y) != (by > y) and x < (bx - ax) * (y - ay) / (by - ay) + ax:
            odd = not odd
    at = np.array([x, y])
    walls = zip(np.array(corners), np.roll(np.array(corners), -1, axis=0))
    return odd and min(to_segment(at, a, b) for a, b in walls) > 0.05


def to_segment(at, a, b):
    share = np.clip((at - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(at - a - share * (b - a))


def clearance(corners, places, walls):
    """Distance by which a path by walls in turn passes the nearest corner, metres."""
    corners = np.array(corners)
    source, receiver = map(np.array, places)

    def line(wall):
        a, b = corners[wall], corners[(wall + 1) % len(corners)]
        along = (b - a) / np.linalg.norm(b - a)
        return a, np.array([-along[1], along[0]])

    images = [source]
    for wall in walls:
        a, normal = line(wall)
        images.append(images[-1] - 2 * ((images[-1] - a) @ normal) * normal)
    points, to = [receiver], receiver
    for wall, image in zip(reversed(walls), reversed(images)):
        a, normal = line(wall)
        run = image - to
        across = run @ normal
        if abs(across) < 1e-12:
            return 0.0
        to = to + ((a - to) @ normal) / across * run
        points.append(to)
    points.append(source)
    return min(to_segment(corner, *leg) for corner in corners for leg in zip(points, points[1:]))


def wall_sequence(source, index, order):
    """Walls of an image of pyroomacoustics in turn, by its chain of generators."""
    walls = []
    while source.orders[index] > 0 and len(walls) <= order:
        walls.append(int(source.walls[index]))
        index = int(source.generators[index])
    return walls[::-1]


def polygons(count, order):
    rng = random.Random(7)
    equal, degenerate, unexplained, largest_m = 0, 0, 0, 0.0
    ours_s = theirs_s = 0.0
    for _ in range(count):
        corners, places = random_polygon(rng)
        scene = sonard.Scene.from_points(corners, reflectance=1.0)
        took_s, found = timed(lambda: sonard.image_sources(scene, *places, order), 1)
        ours_s += took_s
        took_s, source, seen = theirs(polygon_room(corners, order), *places)
        theirs_s += took_s
        numbers = np.flatnonzero(seen)
        left = {int(n): (int(source.orders[n]), source.images[:, n]) for n in numbers}
        for at in range(len(found)):
            image = found.positions_m[at, :2]
            near = [n for n, (o, p) in left.items()
                    if o == found.orders[at] and np.linalg.norm(p - image) < SAME_M]
            if near:
                del left[near[0]]
                equal += 1
                continue
            walls = [int(wall) for wall in found.walls[at] if wall >= 0]
            margin_m = clearance(corners, places, walls)
            largest_m = max(largest_m, margin_m)
            degenerate += margin_m < DEGENERATE_M
            unexplained += margin_m >= DEGENERATE_M
        for number in left:
            margin_m = clearance(corners, places, wall_sequence(source, number, order))
            largest_m = max(largest_m, margin_m)
            degenerate += margin_m < DEGENERATE_M
            unexplained += margin_m >= DEGENERATE_M
    report(f"{count} random polygons, order {order}", ours_s, theirs_s, (equal + degenerate, equal))
    print(f"  {equal} images equal, {degenerate} degenerate (path within {1e3 * DEGENERATE_M:.0f} mm of a corner, "
          f"at most {1e3 * largest_m:.4f} mm), {unexplained} unexplained")
    return unexplained


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--polygons", type=int, default=100)
    parser.add_argument("--hall-order", type=int, default=5)
    parser.add_argument("--repeats", type=int, default=7)
    args = parser.parse_args()
    print(f"sonard {sonard.__version__}, pyroomacoustics {pra.__version__}, numpy {np.__version__}")
    box(args.repeats)
    l_room(args.repeats)
    hall(args.hall_order)
    sys.exit(polygons(args.polygons, 6) > 0)


if __name__ == "__main__":
    main()
