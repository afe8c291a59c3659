#!/usr/bin/env python3
"""Writes tests/data/peers/full_wave.json: scans of rigid bodies in the plane, by boundary integrals.

    pip install numpy scipy                 # tried with numpy 2.4 and scipy 1.17
    python3 tests/peers/full_wave.py        # about an hour on one core

The ranger, its pulses and all conventions are those of tests/data/fullwave/README.md, so that both files
are read alike; the bodies are others: whole boxes, wedges, notches and a step, at which sound also bends
twice. Helmholtz's integral equation for a rigid surface as in two_edges.py, one frequency at a time; what
the aperture receives of a body follows by reciprocity from the field on its surface. `--check` prints
how far the same chain is from the table of head-on walls, and what finer panels change.
"""

import functools
import json
import pathlib
import sys

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import find_peaks
from scipy.special import hankel1

from two_edges import gaps, surface

C, F0, CYCLES, HALF_M, SIGMA_HZ = 343.2, 49_400.0, 16, 0.0192, 7_000.0
STEP_HZ = 250.0  # A window of 4 ms, 1.37 m of way.
FREQUENCIES_HZ = np.arange(F0 - 20_000, F0 + 20_001, STEP_HZ)
AZIMUTHS_DEG = np.arange(0, 360, 3)
NODES, SHARES = np.polynomial.legendre.leggauss(16)
APERTURE = list(zip(HALF_M * NODES, 0.5 * SHARES))
TIME_STEP_S = 2e-6
# From there on Hankel's functions are looked up; their slow part is smooth in 1 / x.
SLOW_GRID = np.linspace(1e-9, 1, 20_001)
SLOW = [hankel1(n, 1 / SLOW_GRID) * np.exp(-1j / SLOW_GRID) / np.sqrt(SLOW_GRID) for n in (0, 1)]


def hankel(order, x):
    far = np.maximum(x, 1)
    slow = np.interp(1 / far, SLOW_GRID, SLOW[order].real) + 1j * np.interp(
        1 / far, SLOW_GRID, SLOW[order].imag
    )
    value = slow * np.exp(1j * far) / np.sqrt(far)
    near = x < 1
    value[near] = hankel1(order, x[near])
    return value


def unit(k):
    """A line source's wave over this is exp(i k r) / sqrt(r) far away."""
    return 0.25j * np.sqrt(2 / (np.pi * k)) * np.exp(-0.25j * np.pi)


def turned(points, degrees, about=(0, 0)):
    turn = np.exp(1j * np.radians(degrees))
    flat = (np.array(points) - about) @ np.array([1, 1j]) * turn
    return [(float(p.real), float(p.imag)) for p in flat + complex(*about)]


def taper(directions, axis):
    off = np.abs((np.degrees(directions) - axis + 180) % 360 - 180)
    return np.where(off < 75, 1, np.where(off > 105, 0, 0.5 * (1 + np.cos(np.pi * (off - 75) / 30))))


class Chain:
    """Places of a body's surface and how the aperture sees them."""

    def __init__(self, bodies, longest_m):
        self.points, self.normals, self.weights, self.sides = surface(bodies, longest_m, steps=7)
        rng = np.random.default_rng(5)
        self.inside = np.concatenate([inner_points(body, 15, rng) for body in bodies])
        self.r, self.cosine = gaps(self.points, self.points, self.normals)
        self.cosine[self.sides[:, None] == self.sides[None, :]] = 0
        self.inner = gaps(self.inside, self.points, self.normals)
        directions = np.arctan2(self.points[:, 1], self.points[:, 0])
        seen = [taper(directions, azimuth).max() > 0 for azimuth in AZIMUTHS_DEG]
        self.azimuths = AZIMUTHS_DEG[seen]

    def received(self, f):
        """By azimuth, over that of a path of 1 m, before spreading is made up for."""
        k = 2 * np.pi * f / C
        layer = lambda r, cosine: 0.25j * k * hankel(1, k * r) * cosine * self.weights
        matrix = np.vstack([
            0.5 * np.eye(len(self.points)) - layer(self.r, self.cosine),
            -layer(*self.inner),
        ])
        known, gradient = zip(*(self.aperture(k, azimuth) for azimuth in self.azimuths))
        known = np.stack(known, axis=1)
        square = matrix.conj().T @ matrix
        field = cho_solve(cho_factor(square), matrix.conj().T @ known)
        return np.einsum("aj,ja->a", np.stack(gradient), field) / unit(k)

    def aperture(self, k, azimuth):
        """Its field at surface and inner points, and the signal received from each surface point."""
        angle = np.radians(azimuth)
        across = np.array([-np.sin(angle), np.cos(angle)])
        there = np.concatenate([self.points, self.inside])
        weight = taper(np.arctan2(there[:, 1], there[:, 0]), azimuth)
        sent, received = np.zeros(len(there), complex), np.zeros(len(self.points), complex)
        for u, share in APERTURE:
            r, cosine = gaps((u * across)[None, :], self.points, self.normals)
            sent += share * 0.25j * hankel(0, k * np.linalg.norm(there - u * across, axis=1))
            received += share * (0.25j * k * hankel(1, k * r) * cosine * self.weights)[0]
        return sent * weight, received * weight[: len(self.points)]


def inner_points(body, count, rng):
    corners = np.array(body)
    low, high = corners.min(axis=0), corners.max(axis=0)
    found = []
    while len(found) < count:
        at = rng.uniform(low, high)
        if winding(corners, at):
            found.append(at)
    return np.array(found)


def winding(corners, at):
    angles = np.angle((corners - at) @ np.array([1, 1j]))
    turns = (np.roll(angles, -1) - angles + np.pi) % (2 * np.pi) - np.pi
    return abs(turns.sum()) > np.pi


def head_on(distance_m):
    """Spectrum of an endless wall that the aperture faces, by its image."""
    places, shares = np.array(APERTURE).T
    r = np.hypot(2 * distance_m, places[:, None] - places[None, :])
    ks = 2 * np.pi * FREQUENCIES_HZ / C
    return np.array([shares @ (0.25j * hankel(0, k * r)) @ shares / unit(k) for k in ks])


def envelopes(spectrum, times_s):
    """Of burst and short pulse, with spreading made up for; not yet divided by a wall's at 1 m."""
    off_hz = FREQUENCIES_HZ - F0
    band = np.exp(-0.5 * (off_hz / SIGMA_HZ) ** 2)
    lasts_s = CYCLES / F0
    burst = lasts_s * np.sinc(off_hz * lasts_s) * np.exp(-1j * np.pi * off_hz * lasts_s)
    # Fields are for exp(-i omega t); pulses were written for the other sign.
    swing = np.exp(-2j * np.pi * off_hz[:, None] * times_s)
    spread = np.sqrt(C * times_s)
    return [np.abs((spectrum * band * pulse) @ swing) * spread for pulse in (np.conj(burst), 1)]


def compensation():
    times_s = np.arange(5e-3, 7e-3, TIME_STEP_S)
    return [envelope.max() for envelope in envelopes(head_on(1.0), times_s)]


def crossing(times_s, envelope, level):
    above = np.flatnonzero(envelope > level)
    if not above.size or above[0] == 0:
        return None
    i = above[0] - 1
    share = (level - envelope[i]) / (envelope[i + 1] - envelope[i])
    return times_s[i] + share * TIME_STEP_S


def maxima(times_s, envelope):
    at, found = find_peaks(envelope, height=0.01, prominence=0.002)
    keep = found["prominences"] > 0.03 * envelope[at]
    return [[round(float(times_s[i]), 6), round(float(envelope[i]), 5)] for i in at[keep]]


@functools.cache
def lead_m(tau, unit_burst):
    times_s = np.arange(5e-3, 7e-3, TIME_STEP_S)
    burst = envelopes(head_on(1.0), times_s)[0] / unit_burst
    return 1.0 - C * crossing(times_s, burst, tau) / 2


def beam(azimuth, spectrum, times_s, units):
    burst, short = [e / u for e, u in zip(envelopes(spectrum, times_s), units)]
    row = {"azimuth": int(azimuth), "peaks": maxima(times_s, burst)}
    row |= {"arrivals": maxima(times_s, short), "threshold": {}}
    for tau in (0.02, 0.05, 0.1):
        range_m = lambda part: (at := crossing(times_s, burst, part * tau)) and round(
            float(C * at / 2 + lead_m(part * tau, units[0])), 5
        )
        names = {"range_unbiased": 1, "range_unbiased_09tau": 0.9, "range_unbiased_11tau": 1.1}
        found = {name: range_m(part) for name, part in names.items()}
        row["threshold"][str(tau)] = found if found["range_unbiased"] else None
    return row


BOX = [(0, -0.12), (0.12, -0.12), (0.12, 0.12), (0, 0.12)]
LONG = 0.2 * np.sqrt(3)
SCENES = {
    "box-10": ("a box, 0.24 by 0.12 m, its long face turned by 10 degrees", [
        turned([(x + 0.6, y) for x, y in BOX], 10, (0.6, 0)),
    ]),
    "box-40": ("the same, turned by 40 degrees: two faces in sight", [
        turned([(x + 0.6, y) for x, y in BOX], 40, (0.66, 0)),
    ]),
    "wedge-32": ("a corner of 32 degrees, pointing at the ranger but for 15 degrees", [
        turned([(0.5, 0), (0.5 + LONG, -0.1), (0.5 + LONG, 0.1)], 15, (0.5, 0)),
    ]),
    "notch-75": ("a notch of 75 degrees in a block", [
        turned([(0.55, -0.14), (0.8, -0.14), (0.8, 0.14), (0.55, 0.14), (0.55, 0.1),
                (0.55 + 0.1 / np.tan(np.radians(37.5)), 0), (0.55, -0.1)], 6, (0.55, 0)),
    ]),
    "notch-120": ("a notch of 120 degrees in a block", [
        turned([(0.55, -0.14), (0.7, -0.14), (0.7, 0.14), (0.55, 0.14), (0.55, 0.12),
                (0.55 + 0.12 / np.tan(np.radians(60)), 0), (0.55, -0.12)], 12, (0.55, 0)),
    ]),
    "gap": ("two boxes with a gap of 80 mm, turned by 8 degrees", [
        turned([(0.55, 0.04), (0.63, 0.04), (0.63, 0.14), (0.55, 0.14)], 8, (0.55, 0)),
        turned([(0.55, -0.14), (0.63, -0.14), (0.63, -0.04), (0.55, -0.04)], 8, (0.55, 0)),
    ]),
    "step": ("a step of 100 mm, turned by 25 degrees", [
        turned([(0.5, -0.12), (0.72, -0.12), (0.72, 0.12), (0.6, 0.12), (0.6, 0), (0.5, 0)], 25,
               (0.55, 0)),
    ]),
}


def segments(bodies):
    return [[*map(float, (*a, *b))] for body in bodies for a, b in zip(body, body[1:] + body[:1])]


def scan(name, longest=1.3):
    what, bodies = SCENES[name]
    chain = Chain(bodies, longest * C / F0)
    print(name, len(chain.points), "points,", len(chain.azimuths), "azimuths", flush=True)
    spectra = np.stack([chain.received(f) for f in FREQUENCIES_HZ], axis=1)
    nearest_m = np.linalg.norm(chain.points, axis=1).min()
    times_s = np.arange(2 * nearest_m / C - 3e-4, 2 * nearest_m / C + 3.6e-3, TIME_STEP_S)
    units = compensation()
    rows = [beam(a, s, times_s, units) for a, s in zip(chain.azimuths, spectra)]
    return {"description": what, "segments": segments(bodies), "sensor": [0.0, 0.0], "scan": rows}


def check():
    units = compensation()
    print("leads", [lead_m(tau, units[0]) for tau in (0.02, 0.05, 0.1)])
    for distance_m in (0.2, 0.3, 0.5, 0.8):
        times_s = np.arange(2 * distance_m / C - 2e-4, 2 * distance_m / C + 1e-3, TIME_STEP_S)
        burst = envelopes(head_on(distance_m), times_s)[0] / units[0]
        bias = [1e3 * (C * crossing(times_s, burst, tau) / 2 - distance_m) for tau in (0.02, 0.05, 0.1)]
        print(distance_m, burst.max(), bias)
    for name, (_, bodies) in SCENES.items():
        for f in (F0 - 8_000, F0):
            rough, fine = [Chain(bodies, n * C / F0).received(f) for n in (1.3, 0.9)]
            print(name, f, "finer panels change", np.abs(rough - fine).max(), "of", np.abs(fine).max())


def main():
    if "--check" in sys.argv:
        return check()
    names = sys.argv[1:] or SCENES
    path = pathlib.Path(__file__).parent.parent / "data/peers/full_wave.json"
    old = json.loads(path.read_text())["scenes"] if path.exists() else {}
    for name in names:
        old[name] = scan(name)
        head = {"c": C, "f0": F0, "piston_half_width_m": HALF_M, "scenes": old}
        path.write_text(json.dumps(head, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    main()
