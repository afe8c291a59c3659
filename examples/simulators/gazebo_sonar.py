"""A sonar in Gazebo: a system in Python that publishes what the model reads at a link.

    <plugin filename="gz-sim-python-system-loader-system" name="gz::sim::systems::PythonSystemLoader">
      <module_name>gazebo_sonar</module_name>
      <link>sonar</link>
      <scene>/path/to/scene.json</scene>
      <topic>/sonar/range</topic>
    </plugin>

Gazebo parses `<sensor type="sonar">` and publishes nothing for it; this does. The scene is a file of sonard: `sonard scene
from-sdf` makes one of the world. It was not run where sonard is tested: Gazebo is on neither Debian's nor PyPI's index.
"""

import math

import gz.sim
import gz.transport
import sonard
from gz.msgs.laserscan_pb2 import LaserScan

PERIOD_S = 0.05


class Sonar:
    """The hooks that Gazebo's loader of Python systems calls."""

    def configure(self, entity, sdf, ecm, event_manager) -> None:
        self.model = sonard.Model(sonard.Scene.load(sdf.get_string("scene", "scene.json")[0]))
        link = gz.sim.Model(entity).link_by_name(ecm, sdf.get_string("link", "sonar")[0])
        self.link = gz.sim.Link(link)
        self.link.enable_velocity_checks(ecm, True)
        self.node = gz.transport.Node()
        self.publisher = self.node.advertise(sdf.get_string("topic", "/sonar/range")[0], LaserScan)
        self.next_s = 0.0

    def post_update(self, info, ecm) -> None:
        now_s = info.sim_time.total_seconds()
        if info.paused or now_s < self.next_s:
            return
        self.next_s = now_s + PERIOD_S
        pose = self.link.world_pose(ecm)
        if pose is None:
            return
        place = pose.pos()
        heading_deg = math.degrees(pose.rot().yaw())
        try:
            reading = self.model.reading((place.x(), place.y(), heading_deg), azimuth_deg=0.0)
        except sonard.PoseError:
            return
        message = LaserScan(frame="sonar", count=1, range_min=0.0, range_max=10.0)
        # A silence is infinite, as REP 117 has it.
        message.ranges.append(math.inf if reading.range_m is None else reading.range_m)
        self.publisher.publish(message)


def get_system() -> Sonar:
    return Sonar()
