"""A view of a robot: it is moved through all it can do, or as it is told, and what touches is shown."""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from mobee.collision.world import World
from mobee.robot.robot import Robot
from services.monitor.blueprint import BACKGROUND
from services.monitor.config import Config
from services.monitor.extent import eye_of
from services.monitor.figure import TIMELINE, Figure
from services.monitor.output import open_output
from services.monitor.sweep import RATE, Stretch, sweep

MOST_NAMES = 4  # a longer legend hides the plot


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
    eye, centre = eye_of(robot)
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


def _free_ports() -> tuple[int, int]:
    """Two ports of loopback that nobody listens on, so that a running system keeps its own."""
    with socket.socket() as first, socket.socket() as second:
        for probe in (first, second):
            probe.bind(("127.0.0.1", 0))
        return int(first.getsockname()[1]), int(second.getsockname()[1])
