"""Sonar in MuJoCo, compared with MuJoCo's own rangefinder, which is a single ray.

A robot drives along a wall at an oblique angle. The ray hits the wall straight ahead; the sonar detects surfaces
perpendicular to its beam, or nothing at all. A `user` sensor provides the reading: MuJoCo invokes a callback at each step.
"""

import mujoco
import numpy as np

import sonard

WORLD = """
<mujoco>
  <option timestep="0.02" gravity="0 0 0"/>
  <worldbody>
    <geom name="south" type="box" size="2 0.05 0.5" pos="2 -0.05 0.5"/>
    <geom name="north" type="box" size="2 0.05 0.5" pos="2 3.05 0.5"/>
    <geom name="west" type="box" size="0.05 1.6 0.5" pos="-0.05 1.5 0.5"/>
    <geom name="east" type="box" size="0.05 1.6 0.5" pos="4.05 1.5 0.5"/>
    <geom name="crate" type="box" size="0.3 0.2 0.5" pos="3 2 0.5" euler="0 0 30"/>
    <body name="robot" pos="0.6 1 0.5">
      <joint name="x" type="slide" axis="1 0 0" damping="1"/>
      <geom type="cylinder" size="0.1 0.05" mass="1" contype="0" conaffinity="0"/>
      <site name="sonar" pos="0 0 0.1" zaxis="0.82 0.57 0"/>
    </body>
  </worldbody>
  <actuator><velocity name="drive" joint="x" kv="20"/></actuator>
  <sensor>
    <rangefinder name="ray" site="sonar"/>
    <user name="sonar" objtype="site" objname="sonar" dim="1" needstage="pos"/>
  </sensor>
</mujoco>
"""


def scene_of(world: mujoco.MjModel) -> sonard.Scene:
    """The upright boxes of a world as walls."""
    data = mujoco.MjData(world)
    mujoco.mj_forward(world, data)
    outlines = []
    for geom in range(world.ngeom):
        if world.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            half = world.geom_size[geom, :2]
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
            turn = data.geom_xmat[geom].reshape(3, 3)[:2, :2]
            outlines.append(corners @ turn.T + data.geom_xpos[geom, :2])
    return sonard.Scene.from_points(outlines[0], obstacles=outlines[1:], name="MuJoCo")


world = mujoco.MjModel.from_xml_string(WORLD)
model = sonard.Model(scene_of(world), max_range_m=4.0)
site, ray = world.site("sonar").id, world.sensor("ray").adr[0]
sonar = world.sensor("sonar").adr[0]


def pose_of(data: mujoco.MjData) -> tuple[float, float, float]:
    """Pose of the sonar: a rangefinder points along the z axis of its site."""
    x, y = data.site_xpos[site, :2]
    ahead = data.site_xmat[site].reshape(3, 3)[:, 2]
    return float(x), float(y), float(np.degrees(np.arctan2(ahead[1], ahead[0])))


def sense(world: mujoco.MjModel, data: mujoco.MjData, stage: int) -> None:
    """Fills the `user` sensor. MuJoCo has one such callback for all models of a process."""
    if stage == mujoco.mjtStage.mjSTAGE_POS:
        data.sensordata[sonar] = model.predict(pose_of(data), [0.0])["range_m"][0]


data = mujoco.MjData(world)
data.ctrl[0] = 0.5
mujoco.set_mjcb_sensor(sense)
try:
    rows = []
    for step in range(200):
        mujoco.mj_step(world, data)
        if step % 20 == 0:
            mujoco.mj_forward(world, data)
            rows.append((data.site_xpos[site, 0], data.sensordata[ray], data.sensordata[sonar]))
            # The sensor contains the prediction of the model at that pose.
            assert data.sensordata[sonar] == model.predict(pose_of(data), [0.0])["range_m"][0]
finally:
    mujoco.set_mjcb_sensor(None)
for x, ray_m, sonar_m in rows:
    reading = f"{sonar_m:.3f} m" if np.isfinite(sonar_m) else "no echo"
    print(f"x {x:.2f} m: the ray {ray_m:.3f} m, the sonar {reading}")
assert any(abs(ray_m - sonar_m) > 0.05 for _, ray_m, sonar_m in rows), "the sonar never differs from the ray"
