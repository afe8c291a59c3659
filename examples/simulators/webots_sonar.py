"""A sonar in Webots: a robot's controller that reads the model at the place of its GPS and compass.

Give the robot a GPS `gps`, an InertialUnit `imu`, and this as its controller; the scene is a file of sonard for the same world.
It was not run where sonard is tested: the module `controller` comes with Webots alone.
"""

import math
import sys

import sonard
from controller import Robot

robot = Robot()
step_ms = int(robot.getBasicTimeStep())
gps, imu = robot.getDevice("gps"), robot.getDevice("imu")
gps.enable(step_ms)
imu.enable(step_ms)
model = sonard.Model(sonard.Scene.load(sys.argv[1] if len(sys.argv) > 1 else "scene.json"))

while robot.step(step_ms) != -1:
    x, y, _ = gps.getValues()
    yaw = imu.getRollPitchYaw()[2]
    try:
        reading = model.reading((x, y, math.degrees(yaw)), azimuth_deg=0.0)
    except sonard.PoseError as error:
        print(f"no reading: {error}")
        continue
    print(f"{robot.getTime():.2f} s: {reading}")
