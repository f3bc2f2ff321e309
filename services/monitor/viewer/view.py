# SPDX-License-Identifier: Apache-2.0
"""Shows a robot in motion, with its contacts: every motor through its range, or given poses."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from mobee.arrays import Array
from mobee.model.world import World
from mobee.robot.robot import Motor, Robot
from mobee.robot.writing import write_whole
from services.monitor.viewer.blueprint import BACKGROUND, eye_of
from services.monitor.viewer.figure import TIMELINE, Figure
from services.monitor.viewer.files import ViewerFiles
from services.monitor.viewer.output import HOST, NoControls
from services.monitor.web.board import Board
from services.monitor.web.server import PageServer, Site

RATE = 20.0  # poses a second
ALONE = 2.0  # s a motor
TOGETHER = 12.0  # s for all


@dataclass(frozen=True, slots=True)
class Stretch:
    """A section of a motion. `title`: description of what moves. `poses`: (k, n) rad, RATE (20) poses per second."""

    title: str
    poses: Array


def sweep(robot: Robot) -> list[Stretch]:
    """Return the sections of a motion through the ranges of all motors. Each section begins and ends at home.

    In the section of a motor only this motor moves: from home to its minimum, then to its maximum, then to home. In the last section all
    motors move at once.
    """
    low, high = robot.limits.T
    home = np.clip(robot.home, low, high)
    stretches = []
    for index, motor in enumerate(robot.motor_table):
        poses = np.tile(home, (round(ALONE * RATE), 1))
        poses[:, index] = _there_and_back(len(poses), home[index], low[index], high[index])
        stretches.append(Stretch(f"{motor.name}: {_reach(robot, motor)}", poses))
    return [*stretches, Stretch("all motors", _together(round(TOGETHER * RATE), home, low, high))]


def _reach(robot: Robot, motor: Motor) -> str:
    """Return the range of a motor's first joint as text, in degrees or m."""
    if not motor.joints:
        return "moves no joint"
    index, scale, offset = motor.joints[0]
    low, high = np.sort(scale * motor.limits + offset)
    if robot.joints[index].kind == "prismatic":
        return f"{low:.3g} to {high:.3g} m"
    return f"{np.rad2deg(low):.4g} to {np.rad2deg(high):.4g} deg"


def _there_and_back(count: int, home: float, low: float, high: float) -> Array:
    """Return positions (count,) rad from home to low, to high and back, with velocity 0 at each turn."""
    turns = np.array([home, low, high, home])
    share = np.linspace(0.0, 3.0, count)
    leg = np.minimum(share.astype(int), 2)
    smooth = 0.5 - 0.5 * np.cos(np.pi * (share - leg))
    return np.asarray(turns[leg] + smooth * (turns[leg + 1] - turns[leg]))


def _together(count: int, home: Array, low: Array, high: Array) -> Array:
    """Return the poses (count, n) rad of a robot whose motors oscillate between their limits, each at its own pace."""
    time = np.linspace(0.0, 1.0, count)[:, None]
    swings = 2 + np.arange(len(home)) % 3
    wave = np.sin(2.0 * np.pi * swings * time)
    return np.asarray(home + np.where(wave > 0, wave * (high - home), wave * (home - low)))


MOST_NAMES = 4  # a longer legend hides the plot


def view(
    robot: Robot,
    world: World | None,
    save: Path | None,
    report: Callable[[str], None],
    stretches: Sequence[Stretch] | None = None,
    solids: bool = False,
) -> None:
    """Show a motion of a robot on a page until the user interrupts with Ctrl-C, or save it to a file.

    `world`: objects around the robot. `save`: file to write (.rrd); None: show a page. `report` is called with the page's address when all
    data are logged. `stretches`: sections of the motion; None: a sweep through the ranges of all motors. `solids`: draw the solids (volumes
    by which contacts are found) instead of the visuals (surfaces in the robot file). Raises OSError if the file cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="mobee-view-") as private:
        file = Path(private) / "view.rrd" if save is None else save
        stream = rr.RecordingStream("mobee")
        kept = stream.memory_recording()  # Rerun's own writer of files never ends, or reports nothing, if the disk is full
        stream.send_blueprint(layout(robot), make_active=False, make_default=True)
        _log(stream, robot, world, sweep(robot) if stretches is None else stretches, solids)
        write_whole(file, kept.drain_as_bytes())
        stream.disconnect()
        if save is None:
            site = Site(Board(), "", NoControls(), None, ViewerFiles(Path(private)).path, lambda: 0.0, {"view.rrd": file})
            server = PageServer(site, HOST, 0)
            report(f"http://{HOST}:{server.port}/viewer.html?recording=view.rrd")
            while True:
                time.sleep(3600.0)


def _log(stream: rr.RecordingStream, robot: Robot, world: World | None, stretches: Sequence[Stretch], solids: bool) -> None:
    figure = Figure(stream, robot, world, solids)
    begin = 0.0
    for stretch in stretches:
        figure.say(begin, stretch.title)
        figure.move(begin, RATE, stretch.poses)
        begin += len(stretch.poses) / RATE
    stream.log("plots/motors", rr.SeriesLines(names=list(robot.motors)), static=True)
    stream.log("plots/contacts", rr.SeriesLines(names=["solids", "fields"]), static=True)


def layout(robot: Robot) -> rrb.Blueprint:
    """Return the layout of the Rerun view: the robot on the left; plots of motors and contacts, and events, on the right."""
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
