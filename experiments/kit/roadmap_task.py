# SPDX-License-Identifier: Apache-2.0
"""Tasks for roadmaps: the model, the costs and the task space from which a roadmap is built, with helpers for the iCub."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

import mobee
from mobee import Geometry, Model, Robot, World, costs
from mobee.arrays import Array
from mobee.rendering.sheet import View
from mobee.roadmap.building.build import MAX_TURN
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik.terms import Term
from mobee.roadmap.roadmap import Roadmap

Method = Literal["nes", "least_squares", "hybrid"]
MARGIN = float(np.deg2rad(10.0))  # rad; the default law lets no motor rest nearer to a limit

LEFT, RIGHT = "left_palm", "right_palm"
DOWN, UP, FORWARD, TO_THE_LEFT, TO_THE_RIGHT = (0, 0, -1), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 1, 0)  # root frame
FINGERS, THUMB = (1, 0, 0), (0, -1, 0)  # their directions in the frame of either palm
THUMBS_UP = np.column_stack([FORWARD, DOWN, TO_THE_LEFT])  # the frame of a palm whose fingers point forward, its thumb up

_HELD = (0.85, 0.45, 0.10, 1.0)  # colour
_JOINTS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw")
_BENT = {  # degrees
    "thumb_oppose": 60,
    "thumb_proximal": 20,
    "thumb_distal": 30,
    "index_proximal": 35,
    "index_distal": 50,
    "middle_proximal": 35,
    "middle_distal": 50,
    "pinky": 80,
}
_ASIDE = {"shoulder_pitch": -40, "shoulder_roll": 40, "shoulder_yaw": -30, "elbow": 100}
_OUT = {"shoulder_pitch": 0, "shoulder_roll": 80, "shoulder_yaw": -20, "elbow": 70}
LEFT_ARM, RIGHT_ARM = (tuple(f"{side}_{joint}" for joint in _JOINTS) for side in "lr")  # without the hand
NECK = ("neck_pitch", "neck_roll", "neck_yaw")
ONE_HAND = ("torso", *RIGHT_ARM)
BOTH_HANDS = ("torso", *LEFT_ARM, *RIGHT_ARM)


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """The arguments of `mobee.build_roadmap` for one roadmap, and a motion through the roadmap for pictures.

    `title`: title of the pictures.  `figure`: number of the figure in the thesis.  `costs`: cost terms whose tolerances every pose must
    satisfy.  `task`: the task space.  `spacing`: distance between vertices, in the units of the task coordinates.  `motors`: names of the
    moving motors or parts.  `start`: (n,) rad, a posture of all motors: start of the search, and where the motors that do not move stay;
    None: home.  `markers`: markers whose positions are drawn for every vertex.  `via`: the pictures show a motion through these task
    coordinates, in this order.  `views`: camera views of these pictures.  `margin`: distance of the motors from their limits [rad]; with
    MARGIN (10 degrees) the default control law, which pushes motors away from their limits, exerts no such force in any pose of the
    roadmap.
    """

    title: str
    figure: str
    model: Model
    costs: tuple[Term, ...]
    task: Task
    spacing: float | tuple[float, ...]
    motors: tuple[str, ...]
    via: Sequence[tuple[float, ...]]
    markers: tuple[str, ...] = ("right_palm",)
    views: Sequence[View] = ("oblique",)
    start: Array | None = None
    margin: float = 0.0


def one_hand(model: Model, title: str, figure: str, terms: Sequence[Term], task: Task, spacing: float, **more: Any) -> Example:
    """Return an example in which torso and right arm move, and the left arm is bent aside.

    The motors stay at least 10 degrees (MARGIN) away from their limits, because nearer to a limit the default control law pushes them away
    from it, so that the robot cannot rest there.

    `title`: title of the pictures.  `figure`: number of the figure in the thesis.  `terms`: costs of this example; those of contacts and of
    the distance from home are added to them.  `task`: the task space.  `spacing`: distance between vertices, in the units of the task
    coordinates.  `more`: other fields of `Example`.  This function sets `motors`, `start` and `margin`; values in `more` replace them.
    """
    return _example(model, title, figure, terms, task, spacing, {"motors": ONE_HAND, "start": left_aside(model.robot)} | more)


def both_hands(model: Model, title: str, figure: str, terms: Sequence[Term], task: Task, spacing: float, **more: Any) -> Example:
    """Return an example in which torso and both arms move.

    The motors stay at least 10 degrees (MARGIN) away from their limits, because nearer to a limit the default control law pushes them away
    from it, so that the robot cannot rest there.

    `title`: title of the pictures.  `figure`: number of the figure in the thesis.  `terms`: costs of this example; those of contacts and of
    the distance from home are added to them.  `task`: the task space.  `spacing`: distance between vertices, in the units of the task
    coordinates.  `more`: other fields of `Example`.  This function sets `motors`, `markers` and `margin`; values in `more` replace them.
    """
    return _example(model, title, figure, terms, task, spacing, {"motors": BOTH_HANDS, "markers": (LEFT, RIGHT)} | more)


def _example(model: Model, title: str, figure: str, terms: Sequence[Term], task: Task, spacing: float, more: Mapping[str, Any]) -> Example:
    every = (*terms, costs.collision(), costs.home())
    return Example(title=title, figure=figure, model=model, costs=every, task=task, spacing=spacing, **{"margin": MARGIN, **more})


def build(
    example: Example,
    method: Method,
    seed: int = 0,
    file: Path | None = None,
    progress: Callable[[Any], None] | None = None,
    neighbours: int | None = None,
    longest: float | None = MAX_TURN,
) -> Roadmap:
    """Build the roadmap of an example with `mobee.build_roadmap`.

    Args:
        example: robot, world, costs, task and motors.
        method: how poses are searched: "nes" (evolution), "least_squares", or "hybrid" (least squares first, then evolution).
        seed: of the random numbers.
        file: .npz file in which the unfinished roadmap is saved, and from which the building resumes; None: not saved.
        progress: called several times per second with the progress; None: not called.
        neighbours: number of nearest vertices to which each vertex is joined; None: as in Algorithm 4 of the thesis.
        longest: edges along which a motor turns by more than this [rad] are left out; None: no edge is left out.
    """
    settings = mobee.RoadmapSettings(method, neighbours, longest, example.margin)
    return mobee.build_roadmap(
        example.model,
        costs=list(example.costs),
        task=example.task,
        spacing=example.spacing,
        start=example.start,
        motors=list(example.motors),
        seed=seed,
        settings=settings,
        file=file,
        progress=progress,
    )


def at_table() -> Model:
    """Return a new model of the iCub at its table, with nothing on the table."""
    world = mobee.load_world("table")
    world.remove("ball")
    return Model(mobee.load_robot("icub"), world)


def alone() -> Model:
    """Return a new model of the iCub in an empty world."""
    return Model(mobee.load_robot("icub"), World())


def carry(model: Model, name: str, shape: Geometry, marker: str, ahead: float, along: ArrayLike = FINGERS) -> None:
    """Attach an object to a hand in the world of `model`; it has the role "ghost", so it exerts no force.

    `name`, `shape`: name and shape of the object.  `marker`: marker of the palm.  `ahead`: distance of the object's centre from the palm,
    along the palm's normal, m.  `along`: direction (3,) of the object's z axis in the palm's frame; by default that of the fingers.
    """
    m = model.robot.marker(marker)
    z = m.rotation @ np.asarray(along, dtype=np.float64)
    x = m.normal - (m.normal @ z) * z
    if not x.any():
        x = m.rotation @ np.asarray(FINGERS, dtype=np.float64)
    x = x / np.linalg.norm(x)
    model.world.add(name, shape, role="ghost", color=_HELD)
    model.world.attach(name, model.robot.links[m.link], (m.position + ahead * m.normal, np.column_stack([x, np.cross(z, x), z])))


def left_aside(robot: Robot) -> Array:
    """Return the home posture (n,) rad, but with the left arm bent, so that its hand does not touch the table when the torso leans."""
    return changed(robot.home, robot, _ASIDE, "l")


def elbows_out(q: Array, robot: Robot, sides: str = "lr") -> Array:
    """Return the posture q (n,) rad, but with the elbows away from the body.

    From there the hands can turn far while the joints move smoothly.  `sides`: the arms to change, "l", "r" or "lr".
    """
    return changed(q, robot, _OUT, sides)


def grasping(q: Array, robot: Robot, sides: str = "lr") -> Array:
    """Return the posture q (n,) rad, but with bent fingers; `sides`: the hands to change, "l", "r" or "lr"."""
    return changed(q, robot, _BENT, sides)


def changed(q: Array, robot: Robot, degrees: Mapping[str, float], sides: str) -> Array:
    """Return the posture q (n,) rad, but with other angles of some arm motors.

    `degrees`: new angles by the motor's name without the side, as "elbow".  `sides`: the arms to change, "l", "r" or "lr".
    """
    new = q.copy()
    for side in sides:
        for joint, angle in degrees.items():
            new[robot.motor_index(f"{side}_{joint}")] = np.deg2rad(angle)
    return new
