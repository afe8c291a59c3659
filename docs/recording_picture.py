"""Draws a recording as Rerun's viewer shows it: python docs/recording_picture.py RECORDING PICTURE.

Rerun reads MCAP by itself; what is given here is which views are open, and from where the floor is seen. Needs the package
rerun-sdk, and a display (xvfb-run) with Vulkan (Debian: mesa-vulkan-drivers)."""

import subprocess
import sys
import tempfile
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

VIEWER = Path(sys.executable).parent / "rerun"
FLOOR = ("+ /sonar/points/**", "+ /sonar/predicted/points/**", "+ /tf/**")
TIMELINE = "message_log_time"


def views():
    above = rrb.EyeControls3D(position=(0.5, -0.4, 5.0), look_target=(0.5, -0.39, 0.0), eye_up=(0, 1, 0))
    return rrb.Horizontal(
        rrb.Spatial3DView(name="echoes, measured and predicted", origin="/", contents=list(FLOOR), eye_controls=above),
        rrb.Vertical(
            rrb.TimeSeriesView(name="range, metres", origin="/sonar/range", axis_y=rrb.ScalarAxis(range=(0, 3))),
            rrb.TimeSeriesView(name="residual, metres", origin="/sonar/residual"),
        ),
        column_shares=[3, 2],
    )


def main(recording, picture):
    hidden = [panel(state="hidden") for panel in (rrb.BlueprintPanel, rrb.SelectionPanel, rrb.TopPanel)]
    # At the end of the recording, where a scan's points are.
    at_end = rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following")
    with tempfile.TemporaryDirectory() as folder:
        shown = str(Path(folder, "shown.rrd"))
        rr.init("sonard")
        rr.save(shown, default_blueprint=rrb.Blueprint(views(), *hidden, at_end, auto_views=False, auto_layout=False))
        rr.log_file_from_path(recording)
        rr.disconnect()
        subprocess.run([VIEWER, shown, "--screenshot-to", picture, "--window-size", "1000x500", "--bind", "127.0.0.1"],
                       check=True)


main(*sys.argv[1:])
