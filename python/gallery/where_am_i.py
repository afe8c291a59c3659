"""Global localisation of a robot from a single sweep of its sonar."""

import sys

import numpy as np

import sonard

scene = sonard.Scene.from_points(
    [[0.0, 0.0], [3.2, 0.0], [3.2, 1.4], [2.1, 1.4], [2.1, 2.6], [0.0, 2.6]], name="an L"
)
model = sonard.Model(scene, max_range_m=4.0)

truth = (0.9, 1.7, 40.0)
ranges_m = model.predict(truth)["range_m"]
rng = np.random.default_rng(1)
measured_m = ranges_m + rng.normal(0, 0.002, ranges_m.shape)

found = sonard.Locator(model).locate(measured_m)
for pose in found:
    print(
        f"{pose['probability']:.3f}: x {pose['x_m']:.3f} m, y {pose['y_m']:.3f} m, heading {pose['heading_deg']:.1f} degrees"
    )
best = found[0]
assert np.hypot(best["x_m"] - truth[0], best["y_m"] - truth[1]) < 0.02

try:
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt
except ImportError:
    sys.exit(0)

direction = np.radians(best["heading_deg"] + np.arange(400) * 0.9)
plt.plot(*scene.walls.transpose(2, 1, 0), "k")
plt.plot(best["x_m"] + measured_m * np.cos(direction), best["y_m"] + measured_m * np.sin(direction), ".")
plt.plot(best["x_m"], best["y_m"], "^")
plt.axis("equal")
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "where_am_i.png")
