# SPDX-License-Identifier: Apache-2.0
"""The tasks of thesis figures 3.1 to 3.11 and 4.8, a function each; docs/roadmaps.md has a task file to copy."""

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
    MARGIN,
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
    carry,
    elbows_out,
    grasping,
    left_aside,
)
from mobee import Geometry, Model, costs, tasks
from mobee.roadmap.ik.terms import Term

PREGRASP_SPACING = 0.008  # m


def held(width: float) -> tuple[Term, Term]:
    """Return costs that hold the palms face to face at a distance [m]: position and orientation of one in the frame of the other."""
    return costs.relative_position(RIGHT, LEFT, (0.0, 0.0, -width)), costs.relative_orientation(RIGHT, LEFT, np.eye(3))


def between_palms(model: Model, shape: Geometry, width: float) -> None:
    """Attach an object between both hands, its z axis from palm to palm, its x axis along the fingers."""
    carry(model, "held", shape, LEFT, 0.5 * width, (0, 0, 1))


def both_held() -> Example:
    """Both hands hold an object and move it up and down, forward and back (thesis fig. 3.1, left).

    Where the hands are to each other is fixed, as by a box between them, and the box stays level and straight before the robot;
    the task space is the height of the hands and how far forward they are.
    """
    width = 0.20  # m, from palm to palm
    model = at_table()
    between_palms(model, mobee.box(0.12, 0.16, width - 0.05), width)
    return Example(
        title="both hands held",
        figure="3.1, left",
        model=model,
        costs=(
            *held(width),
            costs.orientation(RIGHT, TO_THE_LEFT),
            costs.plane(RIGHT, TO_THE_RIGHT, 0.5 * width),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place(RIGHT, "xz", [(-0.48, -0.14), (-0.02, 0.34)]),
        spacing=0.02,
        motors=BOTH_HANDS,
        markers=(LEFT, RIGHT),
        margin=MARGIN,
        via=[(-0.24, 0.04), (-0.40, 0.04), (-0.30, 0.24), (-0.24, 0.26)],
    )


def elbow_down() -> Example:
    """The right hand goes anywhere while its elbow stays down (thesis fig. 3.1, right).

    The elbow is never higher than 10 cm below the shoulder; the task space is the place of the hand.
    """
    highest = 0.05  # m, of the elbow
    model = at_table()
    return Example(
        title="elbow down",
        figure="3.1, right",
        model=model,
        costs=(costs.at_most("right_elbow", UP, highest), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xyz", [(-0.48, -0.12), (-0.20, 0.44), (-0.06, 0.38)]),
        spacing=0.04,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        via=[(-0.26, 0.20, 0.0), (-0.40, 0.06, 0.02), (-0.26, 0.06, 0.22), (-0.22, 0.30, 0.14)],
    )


def palm_side() -> Example:
    """The right hand moves over the table, its palm to the side (thesis fig. 3.2, left): left and right, forward and back."""
    height = 0.0  # m, 10 cm above the table
    model = at_table()
    return Example(
        title="palm to the side",
        figure="3.2, left",
        model=model,
        costs=(costs.orientation(RIGHT, TO_THE_LEFT), costs.plane(RIGHT, UP, height), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xy", [(-0.56, -0.10), (-0.30, 0.46)]),
        spacing=0.02,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        via=[(-0.20, 0.20), (-0.44, 0.16), (-0.36, -0.08), (-0.26, 0.14)],
    )


def palm_down() -> Example:
    """The right hand moves over the table, its palm down (thesis fig. 3.2, right): left and right, forward and back."""
    height = 0.0  # m, 10 cm above the table
    model = at_table()
    return Example(
        title="palm down",
        figure="3.2, right",
        model=model,
        costs=(costs.orientation(RIGHT, DOWN), costs.plane(RIGHT, UP, height), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xy", [(-0.56, -0.06), (-0.30, 0.50)]),
        spacing=0.02,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        via=[(-0.20, 0.24), (-0.44, 0.14), (-0.36, 0.30), (-0.18, 0.34)],
    )


def raise_glass() -> Example:
    """Raise a glass: the held object stays upright at every position of the hand (thesis fig. 3.3).

    The thumb points up, and the hand may turn about that line as a glass may; the task space is the place of the hand.  For picking and
    placing what must not be tipped over.
    """
    model = at_table()
    carry(model, "glass", mobee.cylinder(0.03, 0.12), RIGHT, 0.045, THUMB)
    return Example(
        title="raise a glass",
        figure="3.3",
        model=model,
        costs=(costs.orientation(RIGHT, UP, direction=THUMB), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xyz", [(-0.48, -0.12), (-0.20, 0.44), (-0.02, 0.38)]),
        spacing=0.04,
        motors=ONE_HAND,
        start=grasping(left_aside(model.robot), model.robot, "r"),
        margin=MARGIN,
        via=[(-0.40, 0.20, 0.02), (-0.36, 0.10, 0.10), (-0.28, 0.08, 0.22)],
    )


def bimanual_inspect() -> Example:
    """Look at an object in both hands from all sides: the hands stay, the head moves (thesis figs. 3.4; 3.1, centre).

    Both hands keep their position and orientation, and the gaze stays on the object.  The task space is the position of the head: left and
    right, forward and back.
    """
    width = 0.20  # m, from palm to palm
    middle = np.array([-0.30, 0.0, 0.05])  # m
    model = at_table()
    between_palms(model, mobee.box(0.10, 0.12, width - 0.05), width)
    across = np.multiply(0.5 * width, TO_THE_LEFT)
    return Example(
        title="bimanual inspect",
        figure="3.1, 3.4",
        model=model,
        costs=(
            costs.position(LEFT, middle + across),
            costs.position(RIGHT, middle - across),
            costs.orientation(LEFT, THUMBS_UP),
            costs.orientation(RIGHT, THUMBS_UP),
            costs.gaze(middle, tolerance=np.deg2rad(10.0)),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place("head", "xy", [(-0.12, 0.06), (-0.13, 0.13)]),
        spacing=0.01,
        motors=(*BOTH_HANDS, *NECK),
        markers=("head",),
        via=[(0.02, 0.0), (-0.04, 0.06), (-0.06, 0.0), (-0.04, -0.06)],
    )


def inspect_hand() -> Example:
    """Turn the hand with an object in front of the eyes (thesis fig. 3.5).

    The hand stays at one place and the face is turned to it; the task space is the angle of the palm's normal to the direction of gaze, in
    the horizontal plane: 0 when the palm faces away, half a turn when it is seen from the front.
    """
    place = (-0.26, 0.05, 0.28)  # m
    model = alone()
    carry(model, "held", mobee.box(0.05, 0.05, 0.10), RIGHT, 0.04, THUMB)
    return Example(
        title="inspect",
        figure="3.5",
        model=model,
        costs=(
            costs.position(RIGHT, place),
            costs.across(RIGHT, UP),
            costs.gaze(RIGHT, tolerance=np.deg2rad(10.0)),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, UP, FORWARD, -np.pi / 2, np.pi),
        spacing=float(np.deg2rad(5.0)),
        motors=(*ONE_HAND, *NECK),
        start=elbows_out(grasping(left_aside(model.robot), model.robot, "r"), model.robot, "r"),
        markers=(RIGHT, "right_elbow"),  # the hand itself stays
        via=[(np.deg2rad(170.0),), (np.deg2rad(-60.0),)],
    )


def push_forward() -> Example:
    """Push a large object forward with both hands (thesis fig. 3.6).

    Where the hands are to each other is fixed, as is their height; the task space is how far forward they are.  The object neither turns
    nor goes aside.
    """
    width, height = 0.24, 0.0  # m
    model = at_table()
    between_palms(model, mobee.box(0.18, 0.20, width - 0.05), width)
    return Example(
        title="push forward",
        figure="3.6",
        model=model,
        costs=(
            *held(width),
            costs.orientation(RIGHT, THUMBS_UP),
            costs.plane(RIGHT, UP, height),
            costs.plane(RIGHT, TO_THE_RIGHT, 0.5 * width),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place(RIGHT, "x", [(-0.56, -0.10)]),
        spacing=0.02,
        motors=BOTH_HANDS,
        markers=(LEFT, RIGHT),
        margin=MARGIN,
        via=[(-0.26,), (-0.42,)],
    )


def push_over() -> Example:
    """Push a large object to the side with both hands (thesis fig. 3.7).

    Where the hands are to each other is fixed, as is their height; the task space is how far left or right they are.  The object neither
    turns nor goes forward.
    """
    width, height, before = 0.20, 0.0, 0.32  # m
    model = at_table()
    between_palms(model, mobee.box(0.18, 0.20, width - 0.05), width)
    return Example(
        title="push over",
        figure="3.7",
        model=model,
        costs=(
            *held(width),
            costs.orientation(RIGHT, THUMBS_UP),
            costs.plane(RIGHT, UP, height),
            costs.plane(RIGHT, (1, 0, 0), -before),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place(RIGHT, "y", [(-0.30, 0.50)]),
        spacing=0.02,
        motors=BOTH_HANDS,
        markers=(LEFT, RIGHT),
        margin=MARGIN,
        via=[(0.22,), (-0.02,)],
    )


def reach_into() -> Example:
    """Reach into a box that is open above (thesis fig. 3.8).

    The only constraint is that nothing is touched; the task space is its place, in the box and above it.  For picking from the box and
    placing into it.
    """
    x, y, floor = -0.27, 0.17, -0.22  # m, of the box
    model = alone()
    _put_box(model, x, y, floor)
    return Example(
        title="reach into a box",
        figure="3.8",
        model=model,
        costs=(costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xyz", [(x - 0.16, x + 0.16), (y - 0.16, y + 0.16), (floor, 0.14)]),
        spacing=0.03,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        via=[(x + 0.06, y, 0.05), (x, y, floor + 0.09), (x - 0.03, y - 0.03, 0.08), (x - 0.10, y - 0.14, 0.06)],
    )


def _put_box(model: Model, x: float, y: float, floor: float) -> None:
    side, wall, thick = 0.28, 0.14, 0.01  # m
    half, middle = 0.5 * (side - thick), floor + 0.5 * wall
    model.world.add("floor", mobee.box(side, side, thick), position=(x, y, floor))
    for name, sign in (("far wall", -1), ("near wall", 1)):
        model.world.add(name, mobee.box(thick, side, wall), position=(x + sign * half, y, middle))
    for name, sign in (("left wall", -1), ("right wall", 1)):
        model.world.add(name, mobee.box(side, thick, wall), position=(x, y + sign * half, middle))


def bimanual_rotate() -> Example:
    """Rotate a large object between both hands about the forward direction, as a steering wheel (thesis fig. 3.9).

    Where the hands are to each other is fixed, their palms are parallel and opposite, and the middle between them stays; the task space
    is the angle of the right palm's normal in the plane of up/down and left/right.
    """
    width, middle = 0.20, (-0.30, 0.0, 0.20)  # m
    model = alone()
    between_palms(model, mobee.box(0.12, 0.12, width - 0.05), width)
    return Example(
        title="bimanual rotate",
        figure="3.9",
        model=model,
        costs=(
            *held(width),
            costs.position(RIGHT, middle, tolerance=0.01, offset=(0.0, 0.0, 0.5 * width)),
            costs.across(RIGHT, FORWARD),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, FORWARD, TO_THE_LEFT, -0.4 * np.pi, 0.4 * np.pi),
        spacing=float(np.deg2rad(5.0)),
        motors=BOTH_HANDS,
        start=elbows_out(model.robot.home, model.robot),
        markers=(LEFT, RIGHT),
        views=("front",),
        via=[(np.deg2rad(-55.0),), (np.deg2rad(55.0),)],
    )


def bimanual_twist() -> Example:
    """Twist a large object between both hands about the vertical (thesis fig. 3.10).

    Where the hands are to each other is fixed, their palms are parallel and opposite, and the middle between them stays; the task space
    is the angle of the right palm's normal in the plane of the table.
    """
    width, middle = 0.18, (-0.30, 0.0, 0.20)  # m
    model = at_table()
    between_palms(model, mobee.box(0.12, 0.16, width - 0.05), width)
    return Example(
        title="bimanual twist",
        figure="3.10",
        model=model,
        costs=(
            *held(width),
            costs.position(RIGHT, middle, tolerance=0.01, offset=(0.0, 0.0, 0.5 * width)),
            costs.across(RIGHT, UP),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, UP, TO_THE_LEFT, -np.pi / 2, np.pi / 2),
        spacing=float(np.deg2rad(5.0)),
        motors=BOTH_HANDS,
        start=elbows_out(model.robot.home, model.robot),
        markers=(LEFT, RIGHT),
        views=("top",),
        via=[(np.deg2rad(-40.0),), (np.deg2rad(40.0),)],
    )


def unscrew() -> Example:
    """Unscrew the cap of a bottle (thesis fig. 3.11).

    The left hand keeps its place and orientation, the right one its place above it and its palm down; the task space is how far the right
    hand is turned about its palm's normal, from where its fingers point forward.
    """
    bottle = np.array([-0.32, 0.02, 0.05])  # m, where the left hand holds it
    model = alone()
    carry(model, "bottle", mobee.cylinder(0.025, 0.20), LEFT, 0.045, THUMB)
    return Example(
        title="unscrew",
        figure="3.11",
        model=model,
        costs=(
            costs.position(LEFT, bottle - (0.0, 0.045, 0.0)),
            costs.orientation(LEFT, THUMBS_UP),
            costs.position(RIGHT, bottle + (0.0, 0.0, 0.13)),
            costs.orientation(RIGHT, DOWN),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, UP, FORWARD, -np.pi, np.pi, direction=FINGERS),
        spacing=float(np.deg2rad(5.0)),
        motors=BOTH_HANDS,
        start=grasping(model.robot.home, model.robot),
        markers=(RIGHT, "right_elbow"),  # the hands themselves stay
        via=[(np.deg2rad(0.0),), (np.deg2rad(75.0),)],
    )


def pregrasp() -> Example:
    """The right hand over all of the table that it reaches, palm down, as before a grasp (thesis fig. 4.8): 4400 poses.

    The thesis counts one for every square centimetre of half a square metre, for which both hands are needed; the right palm reaches
    0.3 m^2.
    """
    height = -0.04  # m, 6 cm above the table
    model = at_table()
    return Example(
        title="pre-grasp",
        figure="4.8",
        model=model,
        costs=(costs.orientation(RIGHT, DOWN), costs.plane(RIGHT, UP, height), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xy", [(-0.74, -0.14), (-0.75, 0.75)]),
        spacing=PREGRASP_SPACING,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        via=[(-0.20, 0.24), (-0.44, 0.14), (-0.36, 0.30), (-0.18, 0.34)],
    )


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
