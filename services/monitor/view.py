"""A view of a robot: it is moved through all it can do, or as it is told, and what touches is shown."""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from mobee.collision.world import World
from mobee.kinematics import link_transforms
from mobee.robot.robot import Array, Robot
from services.monitor.blueprint import BACKGROUND
from services.monitor.config import Config
from services.monitor.figure import TIMELINE, Figure
from services.monitor.output import open_output
from services.monitor.sweep import RATE, Stretch, sweep

VIEWPOINT = np.array([-1.0, -0.9, 0.6])  # from where the robot is seen
MOST_NAMES = 4  # a longer legend hides the plot
DISTANCE = 1.4  # of the eye, in diameters of the scene


def view(
    robot: Robot, world: World | None, save: Path | None, tell: Callable[[str], None], stretches: Sequence[Stretch] | None = None
) -> None:
    """Show a motion on a page until the user interrupts or the page's server ends, or save it to a file.

    `tell` is given the page's address when all is there to be seen.  `stretches`: of the motion, RATE poses a second; None: a sweep
    through all that the robot can do.
    """
    web_port, grpc_port = _free_ports()
    config = Config(serve=save is None, web_port=web_port, grpc_port=grpc_port, memory_limit="1GB")
    with open_output(config, layout(robot), save) as output:
        _log(output.stream, robot, world, sweep(robot) if stretches is None else stretches)
        output.stream.disconnect()  # when all has arrived: the page's server keeps it
        if output.page is not None:
            tell(output.url)
            output.page.wait()


def _log(stream: rr.RecordingStream, robot: Robot, world: World | None, stretches: Sequence[Stretch]) -> None:
    figure = Figure(stream, robot, world)
    begin = 0.0
    for stretch in stretches:
        figure.say(begin, stretch.title)
        figure.move(begin, RATE, stretch.poses)
        begin += len(stretch.poses) / RATE
    stream.log("plots/motors", rr.SeriesLines(names=list(robot.motors)), static=True)
    stream.log("plots/contacts", rr.SeriesLines(names=["solids", "fields"]), static=True)


def layout(robot: Robot) -> rrb.Blueprint:
    """The robot large, its motors, contacts and what happens on the right, time below."""
    centre, diameter = _seen(robot)
    eye = centre + DISTANCE * diameter * VIEWPOINT / np.linalg.norm(VIEWPOINT)
    scene = rrb.Spatial3DView(
        origin="/",
        contents=["/robot/**", "/world/**", "/contacts"],
        name=robot.name,
        background=rrb.Background(color=BACKGROUND),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, 1.0)),
    )
    events = rrb.TextLogView(
        origin="/events", name="what moves, what meets", columns=rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["body"])
    )
    legend = rrb.PlotLegend("LeftTop", visible=len(robot.motors) <= MOST_NAMES)
    motors = rrb.TimeSeriesView(origin="/plots/motors", name="motors, % of their range", plot_legend=legend)
    contacts = rrb.TimeSeriesView(origin="/plots/contacts", name="contacts", plot_legend=rrb.PlotLegend("LeftTop"))
    return rrb.Blueprint(
        rrb.Horizontal(scene, rrb.Vertical(motors, contacts, events), column_shares=[2.2, 1]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        auto_views=False,
        auto_layout=False,
    )


def _seen(robot: Robot) -> tuple[Array, float]:
    """Centre (3,) and diameter [m] of the robot at home."""
    transforms = link_transforms(robot, np.clip(robot.home, *robot.limits.T))
    links = [shape.link for shape in robot.shapes] + [joint.parent for joint in robot.joints]
    places = [shape.position for shape in robot.shapes] + [joint.point for joint in robot.joints]
    points = np.array([transforms[link, :3, :3] @ place + transforms[link, :3, 3] for link, place in zip(links, places, strict=True)])
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2.0, float(max(np.linalg.norm(high - low), 0.1))


def _free_ports() -> tuple[int, int]:
    """Two ports of loopback that nobody listens on, so that a running system keeps its own."""
    with socket.socket() as first, socket.socket() as second:
        for probe in (first, second):
            probe.bind(("127.0.0.1", 0))
        return int(first.getsockname()[1]), int(second.getsockname()[1])
