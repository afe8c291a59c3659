#!/usr/bin/env python3
"""Times pyroomacoustics on the L-room of benches/paths.rs: image sources to order 8.

    pip install pyroomacoustics
    python3 benches/peers/l_room.py
"""

import time

import numpy as np
import pyroomacoustics as pra

CORNERS = [[0, 0], [4, 0], [4, 2], [2.5, 2], [2.5, 5], [0, 5]]
AT = [1.13, 0.87]


def once():
    room = pra.Room.from_corners(np.array(CORNERS, dtype=float).T, fs=16000, max_order=8,
                                 materials=pra.Material(0.0))
    room.add_source(AT)
    room.add_microphone(AT)
    begin = time.perf_counter()
    room.image_source_model()
    return time.perf_counter() - begin, int(room.visibility[0][0].sum())


times, counts = zip(*(once() for _ in range(7)))
print(f"pyroomacoustics {pra.__version__}: {counts[0]} images, median {1e6 * sorted(times)[3]:.0f} us")
