#!/usr/bin/env python3
"""Writes tests/data/peers/two_edges.json: fields behind rigid bodies, by boundary integrals.

    pip install numpy scipy                 # tried with numpy 2.4 and scipy 1.17
    python3 tests/peers/two_edges.py

A line source before rigid bodies in the plane; the total field at receivers around their shadow.
Kirchhoff and Helmholtz's integral equation for a rigid surface, u/2 - int u dG/dn = incident field,
by Gauss's quadrature on panels that shrink towards the corners; points inside the bodies, where the
field is nothing, keep it unique at the bodies' inner resonances (Schenck 1968). Panels half as
long again change no field by more than is printed. Fields are given for exp(+i omega t), over that of the
source's cylindrical wave exp(-i k r) / sqrt(r) at r = 1 m.
"""

import json
import pathlib

import numpy as np
from scipy.linalg import lstsq
from scipy.special import hankel1

K = 2 * np.pi * 49_400 / 343.2
WAVE_M = 2 * np.pi / K
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def panels(length_m, longest_m, steps):
    """Ends of the panels of a side, halved towards both of its ends."""
    count = max(2, int(np.ceil(length_m / longest_m)))
    ends = np.linspace(0, length_m, count + 1)
    first = ends[1] * 0.5 ** np.arange(steps, 0, -1)
    return np.concatenate([[0], first, ends[1:-1], length_m - first[::-1], [length_m]])


def surface(bodies, longest_m, steps=9):
    """Points, outward normals, weights and the number of the side of each."""
    points, normals, weights, sides = [], [], [], []
    number = 0
    for body in bodies:
        corners = np.array(body)
        for a, b in zip(corners, np.roll(corners, -1, axis=0)):
            length_m = np.linalg.norm(b - a)
            along = (b - a) / length_m
            ends = panels(length_m, longest_m, steps)
            middle, half = 0.5 * (ends[1:] + ends[:-1]), 0.5 * (ends[1:] - ends[:-1])
            at = (middle[:, None] + half[:, None] * NODES).ravel()
            points.append(a + at[:, None] * along)
            # Corners run counter-clockwise.
            normals.append(np.tile([along[1], -along[0]], (at.size, 1)))
            weights.append((half[:, None] * WEIGHTS).ravel())
            sides.append(np.full(at.size, number))
            number += 1
    return [np.concatenate(part) for part in (points, normals, weights, sides)]


def gaps(targets, points, normals):
    """Distances from points to targets, and cosines of their angles with the normals."""
    gap = targets[:, None, :] - points[None, :, :]
    r = np.maximum(np.linalg.norm(gap, axis=2), 1e-300)
    return r, np.einsum("ijk,jk->ij", gap, normals) / r


def double_layer(targets, points, normals, weights):
    r, cosine = gaps(targets, points, normals)
    return 0.25j * K * hankel1(1, K * r) * cosine * weights


def fields(bodies, source, receivers, longest_m):
    points, normals, weights, sides = surface(bodies, longest_m)
    kernel = double_layer(points, points, normals, weights)
    kernel[sides[:, None] == sides[None, :]] = 0
    matrix = 0.5 * np.eye(len(points)) - kernel
    rng = np.random.default_rng(5)
    inside = []
    for body in bodies:
        share = rng.dirichlet(np.ones(len(body)), 15)
        inside.append(share @ np.array(body))
    inside = np.concatenate(inside)
    matrix = np.vstack([matrix, -double_layer(inside, points, normals, weights)])
    incident = lambda at: 0.25j * hankel1(0, K * np.linalg.norm(at - source, axis=1))
    known = np.concatenate([incident(points), incident(inside)])
    field, *_ = lstsq(matrix, known, lapack_driver="gelsy")
    received = incident(receivers) + double_layer(receivers, points, normals, weights) @ field
    unit = 0.25j * np.sqrt(2 / (np.pi * K)) * np.exp(-0.25j * np.pi)
    return np.conj(received / unit)


def arc(center, radius_m, from_deg, to_deg, count):
    angles = np.radians(np.linspace(from_deg, to_deg, count))
    return center + radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)


CASES = {
    # A thick wall, from the front to straight behind it: over two corners, whose faces join them.
    "box": (
        [[(-0.05, -0.1), (0.05, -0.1), (0.05, 0.1), (-0.05, 0.1)]],
        np.array([-0.15, 0.01]),
        arc(np.array([0.0, 0.0]), 0.2, 110, 0, 111),
    ),
    # Two leaning blades; their sharp edges see each other straight over the air between.
    "blades": (
        [
            [(-0.09, -0.25), (-0.05, -0.25), (0.0, 0.0)],
            [(0.2, -0.25), (0.24, -0.25), (0.15, 0.0)],
        ],
        np.array([-0.25, -0.2]),
        arc(np.array([0.15, 0.0]), 0.2, 100, -20, 121),
    ),
    # The same box, with the transmitter all but in line with two corners.
    "box-in-line": (
        [[(-0.05, -0.1), (0.05, -0.1), (0.05, 0.1), (-0.05, 0.1)]],
        np.array([-0.5, 0.03]),
        arc(np.array([0.0, 0.0]), 0.35, 60, -10, 71),
    ),
}


def main():
    cases = []
    for name, (bodies, source, receivers) in CASES.items():
        rough, fine = [fields(bodies, source, receivers, n * WAVE_M) for n in (1.5, 1.0)]
        print(name, "changes by", np.abs(rough - fine).max(), "of", np.abs(fine).max())
        rows = [
            [round(float(v), 6) for v in (x, y, u.real, u.imag)]
            for (x, y), u in zip(receivers, fine)
        ]
        cases.append({"name": name, "bodies": bodies, "source": source.tolist(), "field": rows})
    path = pathlib.Path(__file__).parent.parent / "data/peers/two_edges.json"
    lines = ",\n".join(json.dumps(case) for case in cases)
    path.write_text(f'{{"wave_number_per_m": {K}, "cases": [\n{lines}\n]}}\n')


if __name__ == "__main__":
    main()
