# SPDX-License-Identifier: Apache-2.0
"""The tasks of thesis figures 3.1 to 3.11 and 4.8, one function for each task.  docs/roadmaps.md has a task file that you can copy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import mobee
from experiments.kit.roadmap_task import (
    BOTH_HANDS,
    DOWN,
    FINGERS,
    FORWARD,
    LEFT,
    NECK,
    ONE_HAND,
    RIGHT,
    THUMB,
    THUMBS_UP,
    TO_THE_LEFT,
    TO_THE_RIGHT,
    UP,
    Example,
    alone,
    at_table,
    both_hands,
    carry,
    elbows_out,
    grasping,
    left_aside,
    one_hand,
)
from mobee import Geometry, Model, costs, tasks
from mobee.rendering.sheet import View
from mobee.roadmap.ik.terms import Term

PREGRASP_SPACING = 0.008  # m
FIVE_DEGREES = float(np.deg2rad(5.0))  # rad
OVER_TABLE = [(-0.20, 0.24), (-0.44, 0.14), (-0.36, 0.30), (-0.18, 0.34)]  # m, x and y
Via = list[tuple[float, ...]]


def _degrees(*angles: float) -> Via:
    return [(float(np.deg2rad(angle)),) for angle in angles]


def held(width: float) -> tuple[Term, Term]:
    """Return two costs that hold the palms face to face with a distance of `width` [m].

    They fix the position and the orientation of the right palm in the frame of the left palm.
    """
    return costs.relative_position(RIGHT, LEFT, (0.0, 0.0, -width)), costs.relative_orientation(RIGHT, LEFT, np.eye(3))


def between_palms(model: Model, shape: Geometry, width: float) -> None:
    """Attach an object of the given shape between both hands, in the world of the model.

    Its z axis points from palm to palm, its x axis along the fingers.  `width`: distance between the palms [m].
    """
    carry(model, "held", shape, LEFT, 0.5 * width, (0, 0, 1))


def both_held() -> Example:
    """Both hands hold an object and move it up and down, forward and back (thesis fig. 3.1, left).

    The pose of one hand relative to the other is fixed, as if a box were between them.  The box stays level, straight and in front of the
    robot.  The task space is the position (x, z) of the hands, in m, root frame.
    """
    width = 0.20  # m, from palm to palm
    model = at_table()
    between_palms(model, mobee.box(0.12, 0.16, width - 0.05), width)
    terms = [*held(width), costs.orientation(RIGHT, TO_THE_LEFT), costs.plane(RIGHT, TO_THE_RIGHT, 0.5 * width)]
    task = tasks.place(RIGHT, "xz", [(-0.48, -0.14), (-0.02, 0.34)])
    via = [(-0.24, 0.04), (-0.40, 0.04), (-0.30, 0.24), (-0.24, 0.26)]
    return both_hands(model, "both hands held", "3.1, left", terms, task, 0.02, via=via)


def elbow_down() -> Example:
    """The right hand moves in front of the robot while its elbow stays low (thesis fig. 3.1, right).

    The elbow stays at most 5 cm above the origin of the root frame; this limit is 10 cm below the shoulder.  The task space is the position
    (x, y, z) of the hand, in m, root frame.
    """
    highest = 0.05  # m, of the elbow
    task = tasks.place(RIGHT, "xyz", [(-0.48, -0.12), (-0.20, 0.44), (-0.06, 0.38)])
    via = [(-0.26, 0.20, 0.0), (-0.40, 0.06, 0.02), (-0.26, 0.06, 0.22), (-0.22, 0.30, 0.14)]
    return one_hand(at_table(), "elbow down", "3.1, right", [costs.at_most("right_elbow", UP, highest)], task, 0.04, via=via)


def palm_side() -> Example:
    """The right hand moves 10 cm above the table, its palm to the side (thesis fig. 3.2, left).

    The task space is the position (x, y) of the hand, in m, root frame: back and forward, left and right.
    """
    terms = [costs.orientation(RIGHT, TO_THE_LEFT), costs.plane(RIGHT, UP, 0.0)]  # 10 cm above the table
    task = tasks.place(RIGHT, "xy", [(-0.56, -0.10), (-0.30, 0.46)])
    via = [(-0.20, 0.20), (-0.44, 0.16), (-0.36, -0.08), (-0.26, 0.14)]
    return one_hand(at_table(), "palm to the side", "3.2, left", terms, task, 0.02, via=via)


def palm_down() -> Example:
    """The right hand moves 10 cm above the table, its palm down (thesis fig. 3.2, right).

    The task space is the position (x, y) of the hand, in m, root frame: back and forward, left and right.
    """
    terms = [costs.orientation(RIGHT, DOWN), costs.plane(RIGHT, UP, 0.0)]  # 10 cm above the table
    task = tasks.place(RIGHT, "xy", [(-0.56, -0.06), (-0.30, 0.50)])
    return one_hand(at_table(), "palm down", "3.2, right", terms, task, 0.02, via=OVER_TABLE)


def raise_glass() -> Example:
    """Raise a glass: the held object stays upright at every position of the hand (thesis fig. 3.3).

    The thumb points up (root frame).  The hand may rotate about the vertical axis, because this does not tilt the glass.  The task space is
    the position (x, y, z) of the hand, in m, root frame.  The roadmap is useful for picking and placing objects that must stay upright.
    """
    model = at_table()
    carry(model, "glass", mobee.cylinder(0.03, 0.12), RIGHT, 0.045, THUMB)
    terms = [costs.orientation(RIGHT, UP, direction=THUMB)]
    task = tasks.place(RIGHT, "xyz", [(-0.48, -0.12), (-0.20, 0.44), (-0.02, 0.38)])
    start = grasping(left_aside(model.robot), model.robot, "r")
    via = [(-0.40, 0.20, 0.02), (-0.36, 0.10, 0.10), (-0.28, 0.08, 0.22)]
    return one_hand(model, "raise a glass", "3.3", terms, task, 0.04, start=start, via=via)


def bimanual_inspect() -> Example:
    """Look at an object in both hands from all sides: the hands stay, the head moves (thesis figs. 3.4; 3.1, centre).

    Both hands keep their position and orientation, and the gaze stays on the object.  The task space is the position (x, y) of the head, in
    m, root frame: back and forward, left and right.
    """
    width = 0.20  # m, from palm to palm
    middle = np.array([-0.30, 0.0, 0.05])  # m
    model = at_table()
    between_palms(model, mobee.box(0.10, 0.12, width - 0.05), width)
    across = np.multiply(0.5 * width, TO_THE_LEFT)
    terms = [costs.position(LEFT, middle + across), costs.position(RIGHT, middle - across)]
    terms += [costs.orientation(LEFT, THUMBS_UP), costs.orientation(RIGHT, THUMBS_UP), costs.gaze(middle, tolerance=np.deg2rad(10.0))]
    task = tasks.place("head", "xy", [(-0.12, 0.06), (-0.13, 0.13)])
    more = {"motors": (*BOTH_HANDS, *NECK), "markers": ("head",), "margin": 0.0}
    via = [(0.02, 0.0), (-0.04, 0.06), (-0.06, 0.0), (-0.04, -0.06)]
    return both_hands(model, "bimanual inspect", "3.1, 3.4", terms, task, 0.01, via=via, **more)


def inspect_hand() -> Example:
    """Rotate the right hand and its object in front of the eyes (thesis fig. 3.5).

    The hand stays at one position, and the gaze is directed at it.  The task space is the direction of the palm's normal in the horizontal
    plane, as an angle [rad] about the vertical axis: 0 when the palm points forward, away from the robot, and pi when it points back,
    towards the robot.
    """
    place = (-0.26, 0.05, 0.28)  # m
    model = alone()
    carry(model, "held", mobee.box(0.05, 0.05, 0.10), RIGHT, 0.04, THUMB)
    terms = [costs.position(RIGHT, place), costs.across(RIGHT, UP), costs.gaze(RIGHT, tolerance=np.deg2rad(10.0))]
    task = tasks.angle(RIGHT, UP, FORWARD, -np.pi / 2, np.pi)
    start = elbows_out(grasping(left_aside(model.robot), model.robot, "r"), model.robot, "r")
    more = {"motors": (*ONE_HAND, *NECK), "markers": (RIGHT, "right_elbow"), "margin": 0.0}  # the hand itself stays
    return one_hand(model, "inspect", "3.5", terms, task, FIVE_DEGREES, start=start, via=_degrees(170.0, -60.0), **more)


def push_forward() -> Example:
    """Push a large object forward with both hands (thesis fig. 3.6).

    The pose of one hand relative to the other is fixed, and so is their height.  The object neither rotates nor moves sideways.  The task
    space is the position x of the hands, in m, root frame: back and forward.
    """
    width, height = 0.24, 0.0  # m
    model = at_table()
    between_palms(model, mobee.box(0.18, 0.20, width - 0.05), width)
    terms = [*held(width), costs.orientation(RIGHT, THUMBS_UP)]
    terms += [costs.plane(RIGHT, UP, height), costs.plane(RIGHT, TO_THE_RIGHT, 0.5 * width)]
    task = tasks.place(RIGHT, "x", [(-0.56, -0.10)])
    return both_hands(model, "push forward", "3.6", terms, task, 0.02, via=[(-0.26,), (-0.42,)])


def push_over() -> Example:
    """Push a large object to the side with both hands (thesis fig. 3.7).

    The pose of one hand relative to the other is fixed, and so is their height.  The object neither rotates nor moves forward.  The task
    space is the position y of the hands, in m, root frame: left and right.
    """
    width, height, before = 0.20, 0.0, 0.32  # m
    model = at_table()
    between_palms(model, mobee.box(0.18, 0.20, width - 0.05), width)
    terms = [*held(width), costs.orientation(RIGHT, THUMBS_UP), costs.plane(RIGHT, UP, height), costs.plane(RIGHT, (1, 0, 0), -before)]
    return both_hands(model, "push over", "3.7", terms, tasks.place(RIGHT, "y", [(-0.30, 0.50)]), 0.02, via=[(0.22,), (-0.02,)])


def reach_into() -> Example:
    """Reach with the right hand into a box that is open above (thesis fig. 3.8).

    The only constraint is that nothing is touched.  The task space is the position (x, y, z) of the hand, in m, root frame, in the box and
    above it.  The roadmap is useful for picking from the box and placing into it.
    """
    x, y, floor = -0.27, 0.17, -0.22  # m, of the box
    model = alone()
    _put_box(model, x, y, floor)
    task = tasks.place(RIGHT, "xyz", [(x - 0.16, x + 0.16), (y - 0.16, y + 0.16), (floor, 0.14)])
    via = [(x + 0.06, y, 0.05), (x, y, floor + 0.09), (x - 0.03, y - 0.03, 0.08), (x - 0.10, y - 0.14, 0.06)]
    return one_hand(model, "reach into a box", "3.8", [], task, 0.03, via=via)


def _put_box(model: Model, x: float, y: float, floor: float) -> None:
    side, wall, thick = 0.28, 0.14, 0.01  # m
    half, middle = 0.5 * (side - thick), floor + 0.5 * wall
    model.world.add("floor", mobee.box(side, side, thick), position=(x, y, floor))
    for name, sign in (("far wall", -1), ("near wall", 1)):
        model.world.add(name, mobee.box(thick, side, wall), position=(x + sign * half, y, middle))
    for name, sign in (("left wall", -1), ("right wall", 1)):
        model.world.add(name, mobee.box(side, thick, wall), position=(x, y + sign * half, middle))


def _turned(
    model: Model, title: str, figure: str, width: float, across: tuple[int, int, int], most: float, view: View, via: Via
) -> Example:
    """Return an example in which both hands hold an object between parallel palms and turn it about an axis, at a fixed place.

    `width`: distance of the palms [m].  `across`: direction of the axis, root frame; the normals of the palms stay perpendicular to it.
    `most`: the task coordinate, the angle of the right palm's normal about the axis, goes from -most to most [rad].  `view` and `via`: see
    `Example`.
    """
    middle = (-0.30, 0.0, 0.20)  # m
    between_palms(model, mobee.box(0.12, 0.12 if view == "front" else 0.16, width - 0.05), width)
    terms = [*held(width), costs.position(RIGHT, middle, tolerance=0.01, offset=(0.0, 0.0, 0.5 * width)), costs.across(RIGHT, across)]
    task = tasks.angle(RIGHT, across, TO_THE_LEFT, -most, most)
    more = {"start": elbows_out(model.robot.home, model.robot), "views": (view,), "margin": 0.0}
    return both_hands(model, title, figure, terms, task, FIVE_DEGREES, via=via, **more)


def bimanual_rotate() -> Example:
    """Rotate a large object between both hands about the forward direction, like a steering wheel (thesis fig. 3.9).

    The task space is the angle [rad] of the right palm's normal in the vertical plane of y and z; 0 when the palm faces left.
    """
    return _turned(alone(), "bimanual rotate", "3.9", 0.20, FORWARD, 0.4 * np.pi, "front", _degrees(-55.0, 55.0))


def bimanual_twist() -> Example:
    """Rotate a large object between both hands about the vertical axis (thesis fig. 3.10).

    The task space is the angle [rad] of the right palm's normal in the horizontal plane; 0 when the palm faces left.
    """
    return _turned(at_table(), "bimanual twist", "3.10", 0.18, UP, np.pi / 2, "top", _degrees(-40.0, 40.0))


def unscrew() -> Example:
    """Unscrew the cap of a bottle (thesis fig. 3.11).

    The left hand holds the bottle and keeps its position and orientation; the right hand stays above it with its palm down.  The task space
    is the angle [rad] of the right hand about the vertical axis, 0 when its fingers point forward.
    """
    bottle = np.array([-0.32, 0.02, 0.05])  # m, where the left hand holds it
    model = alone()
    carry(model, "bottle", mobee.cylinder(0.025, 0.20), LEFT, 0.045, THUMB)
    terms = [costs.position(LEFT, bottle - (0.0, 0.045, 0.0)), costs.orientation(LEFT, THUMBS_UP)]
    terms += [costs.position(RIGHT, bottle + (0.0, 0.0, 0.13)), costs.orientation(RIGHT, DOWN)]
    task = tasks.angle(RIGHT, UP, FORWARD, -np.pi, np.pi, direction=FINGERS)
    start, markers = grasping(model.robot.home, model.robot), (RIGHT, "right_elbow")  # the hands themselves stay
    return both_hands(
        model, "unscrew", "3.11", terms, task, FIVE_DEGREES, start=start, markers=markers, margin=0.0, via=_degrees(0.0, 75.0)
    )


def pregrasp() -> Example:
    """Move the right hand, palm down, 6 cm above the table, to where it could begin a grasp (thesis fig. 4.8).

    The task space is the position (x, y) of the hand, in m, root frame.  The map has about 4400 poses.  The thesis has about 5000, one for
    every square centimetre of half a square metre.  The right palm alone reaches only 0.3 m^2; half a square metre needs both hands.
    """
    terms = [costs.orientation(RIGHT, DOWN), costs.plane(RIGHT, UP, -0.04)]  # 6 cm above the table
    task = tasks.place(RIGHT, "xy", [(-0.74, -0.14), (-0.75, 0.75)])
    return one_hand(at_table(), "pre-grasp", "4.8", terms, task, PREGRASP_SPACING, via=OVER_TABLE)


EXAMPLES: dict[str, Callable[[], Example]] = {  # in the order of the thesis
    "both-held": both_held,
    "elbow-down": elbow_down,
    "palm-side": palm_side,
    "palm-down": palm_down,
    "raise-glass": raise_glass,
    "bimanual-inspect": bimanual_inspect,
    "inspect": inspect_hand,
    "push-forward": push_forward,
    "push-over": push_over,
    "reach-into": reach_into,
    "bimanual-rotate": bimanual_rotate,
    "bimanual-twist": bimanual_twist,
    "unscrew": unscrew,
    "pregrasp": pregrasp,
}
