"""Map of the beams that measure the nearest wall, and of those that measure a multiple reflection."""

import sys

import numpy as np

import sonard

scene = sonard.Scene.from_points(
    [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.5, 3.0], [2.5, 2.2], [0.0, 2.2]],
    obstacles=[[[1.2, 0.8], [1.8, 0.8], [1.8, 1.2], [1.2, 1.2]]],
    name="an L with a pillar",
)
model = sonard.Model(scene, max_range_m=6.0)

step_m = 0.1
xs, ys = np.arange(0.05, 4, step_m), np.arange(0.05, 3, step_m)
grid = np.stack(np.meshgrid(xs, ys), axis=-1)
free = scene.are_accessible(grid)
places = grid[free]
poses = np.column_stack([places, np.zeros(len(places))])

azimuths_deg = np.arange(0, 360, 5.0)
readings = model.predict(poses, azimuths_deg)

# Fraction of the beams with a longer range than an ideal laser at the same pose.
simple = sonard.Model(scene, engine="cone", aperture_deg=0.0, max_range_m=6.0).predict(poses, azimuths_deg)
long = readings["range_m"] > simple["range_m"] + 0.1
share = np.full(free.shape, np.nan)
share[free] = long.mean(axis=1)
print(f"{readings.size} readings at {len(places)} places: {long.mean():.0%} are longer than the distance straight ahead")

try:
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt
except ImportError:
    sys.exit(0)

plt.imshow(share, origin="lower", extent=(0, 4, 0, 3))
plt.colorbar(label="fraction of beams with too long a range")
plt.plot(*scene.walls.transpose(2, 1, 0), "k")
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "blind_spots.png")
