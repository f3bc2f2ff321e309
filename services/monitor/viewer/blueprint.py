# SPDX-License-Identifier: Apache-2.0
"""The layout of the 3D view, and a camera position from which the whole robot is visible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun.blueprint as rrb

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.rendering.palette import colors_of
from mobee.robot.cameras import EYES
from mobee.robot.robot import Robot
from services.common.worlds import AT_TABLE

VIEWPOINT = np.array([-1.0, -0.9, 0.6])  # direction from which a robot is seen
DISTANCE = 1.4  # of the eye, in diameters of the robot
SMALLEST = 0.1  # m


def extent_of(robot: Robot) -> tuple[Array, float]:
    """Return the centre (3,) m and the diagonal [m] of the box around all shape centres and joints of the robot at home (root frame)."""
    transforms = link_transforms(robot, np.clip(robot.home, *robot.limits.T))
    links = [shape.link for shape in robot.shapes] + [joint.parent for joint in robot.joints]
    places = [shape.position for shape in robot.shapes] + [joint.point for joint in robot.joints]
    points = np.array([transforms[link, :3, :3] @ place + transforms[link, :3, 3] for link, place in zip(links, places, strict=True)])
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2.0, max(float(np.linalg.norm(high - low)), SMALLEST)


def eye_of(robot: Robot) -> tuple[Array, Array]:
    """Return the position of a camera that sees the whole robot, and the point at which it looks, each (3,) m in the root frame."""
    centre, diameter = extent_of(robot)
    eye: Array = centre + DISTANCE * diameter * VIEWPOINT / np.linalg.norm(VIEWPOINT)
    return eye, centre


TIMELINE = "robot_time"
ROOT = "root_link"  # frame of everything in the scene
BACKGROUND = (24, 27, 33)
WINDOW = 30.0  # s of plot
SURPRISE = (0.0, 0.065)  # nats: the largest reward is .0589 (thesis table 6.3); equal rewards would be drawn around 0 otherwise
MOST_EYES = 4  # cameras on the page


@dataclass(frozen=True)
class Shown:
    """The content of the monitor's 3D view.

    `name`: title of the tab with the robot. `parts`: parts whose motion is plotted. `cameras`: cameras that may have pictures to show.
    `eye`: position of the viewer's camera; `target`: point at which it looks; both (3,) m in the root frame.
    """

    name: str
    parts: tuple[str, ...]
    cameras: tuple[str, ...]
    eye: Array
    target: Array


def shown_of(robot: Robot, cameras: Sequence[str] = ()) -> Shown:
    """Return the content of the 3D view for a robot and its cameras: title, parts, cameras and viewpoint.

    For the iCub the viewpoint is fixed, so that both robot and table are visible. For other robots it follows from their size.
    """
    parts = tuple(colors_of(robot.parts))
    if robot.name in AT_TABLE:
        return Shown("iCub", parts, tuple(cameras), np.array([-0.98, -0.60, 0.42]), np.array([-0.14, 0.0, 0.06]))
    return Shown(robot.name, parts, tuple(cameras), *eye_of(robot))


def blueprint(shown: Shown, in_motion: bool = True) -> rrb.Blueprint:
    """Build the layout of the 3D view: tabs with the robot, camera pictures, motion, learning, state spaces and events.

    `in_motion`: False: only the tab with the robot.
    """
    eyes = [rrb.Grid(*map(_eye, shown.cameras[:MOST_EYES]), name="eyes")] if shown.cameras else []
    others: list[rrb.Container | rrb.View] = [*eyes, _motion(shown.parts), _learning(), _spaces(shown.parts), _log()] if in_motion else []
    return rrb.Blueprint(
        rrb.Tabs(_scene(shown), *others, active_tab=0),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TopPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _motion(parts: Sequence[str]) -> rrb.Grid:
    """Return the view of the joints' positions and goals, and of the forces."""
    plots = [_plot(f"{part.replace('_', ' ')}: state and goal (thin), rad", f"plots/joints/{part}") for part in parts]
    return rrb.Grid(*plots, _plot("forces, rad/s²", "plots/forces"), name="motion")


def _learning() -> rrb.Vertical:
    return rrb.Vertical(
        _plot("reward, nats", "plots/reward", rrb.ScalarAxis(range=SURPRISE)),
        _plot("value, nats", "plots/value"),
        _plot("transitions", "plots/transitions"),
        name="learning",
    )


def _spaces(parts: Sequence[str]) -> rrb.Horizontal:
    """Return one column for each agent: its state space, with surprising actions coloured, and bar charts of all state-actions."""
    shares = [1.0 if part == "torso" else 1.4 for part in parts]
    return rrb.Horizontal(*(_agent(part) for part in parts), column_shares=shares, name="states")


def _agent(part: str) -> rrb.Vertical:
    named = part.replace("_", " ")
    space = rrb.Spatial2DView(
        origin=f"/learning/{part}/space",
        name=f"{named}: states, actions that surprised it coloured",
        background=rrb.Background(color=BACKGROUND),
    )
    bars = [
        rrb.BarChartView(origin=f"/learning/{part}/{name}", name=f"{named}: {title}", plot_legend=rrb.PlotLegend(visible=False))
        for name, title in (("tries", "tries of state-actions"), ("reward", "reward, nats"), ("value", "value"))
    ]
    return rrb.Vertical(space, *bars, row_shares=[3, 1, 1, 1])


def _scene(shown: Shown) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/",
        contents=["/scene/**", "/robot/**"],
        name=shown.name,
        background=rrb.Background(color=BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=False),
        spatial_information=rrb.SpatialInformation(target_frame=ROOT),
        eye_controls=rrb.EyeControls3D(position=shown.eye, look_target=shown.target, eye_up=(0.0, 0.0, 1.0)),
    )


def _eye(name: str) -> rrb.Spatial2DView:
    title = f"{name} eye" if name in EYES else name
    return rrb.Spatial2DView(origin=f"/eyes/{name}", name=title, background=rrb.Background(color=BACKGROUND))


def _log() -> rrb.TextLogView:
    columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"])
    return rrb.TextLogView(origin="/events", name="events", columns=columns)


def _plot(title: str, origin: str, axis: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
    window = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.cursor_relative(seconds=-WINDOW), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    return rrb.TimeSeriesView(origin=f"/{origin}", name=title, time_ranges=window, plot_legend=rrb.PlotLegend("LeftTop"), axis_y=axis)
