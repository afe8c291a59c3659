"""Scan of a small room: predicted readings and actual walls."""

import sys

import numpy as np

import sonard

scene = sonard.Scene.shipped("simple-room")
model = sonard.Model(scene)
x, y, heading = pose = scene.poses["fig9"]
readings = model.predict(pose)

echoes = readings["status"] == sonard.Status.ECHO
directions = np.radians(heading + np.arange(400) * 0.9)[echoes]
ranges_m = readings["range_m"][echoes]
points = np.column_stack([x + ranges_m * np.cos(directions), y + ranges_m * np.sin(directions)])
print(f"{echoes.sum()} of {readings.size} firings return an echo, {(scene.clearance_m(points) < 0.02).sum()} of them from the wall ahead")

try:
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt
except ImportError:
    sys.exit(0)

plt.plot(*scene.walls.transpose(2, 1, 0), "k")
plt.plot(*points.T, ".", x, y, "^")
path = model.reading(pose, 270.0).path
if path is not None:
    plt.plot(*np.vstack([(x, y), path.points, (x, y)]).T, "--", label=f"at 270 degrees: {path}")
plt.legend()
plt.axis("equal")
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "first_picture.png")
