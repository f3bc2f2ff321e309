# SPDX-License-Identifier: Apache-2.0
"""The published learners: robot, plants, state spaces and agents of thesis chapter 7 and paper section 3, and poses of the left arm.

The robot is `icub_2014` with the gains published in 2014 and a control period of 20 ms; its motors are the plant's defaults
(docs/plant.md).  Motors that take no part in learning do not move.  Those of the arms stay in the middle of their range, which is also
their position in the goals of the actions; all others stay at home.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import mobee
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, World
from mobee.arrays import Array
from mobee.robot.robot import Clause, Motor, Robot

ROBOT = "icub_2014"
DT = 0.02  # s
TORSO = ("torso_yaw", "torso_roll", "torso_pitch")
LEFT = ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow")
RIGHT = tuple("r" + name[1:] for name in LEFT)

HYPERCUBE = (0.25, 0.75)  # 16 states, 64 actions (thesis 7.1)
RANK3 = (0.25, 0.5, 0.75)  # 81 states, 432 actions to equidistant neighbours, 1296 to the 16 nearest (7.2)
RANK4 = (0.2, 0.4, 0.6, 0.8)  # 256 states, 1536 actions to equidistant neighbours (7.3)
STRETCHED = (0.125, 0.375, 0.625, 0.875)
ARM_NEIGHBOURS, TORSO_NEIGHBOURS = 16, 8  # of the table experiment (7.4)

PART, JOINTS = "left_arm", len(LEFT)  # of the arm that learns alone

Neighbours = int | Literal["equidistant"]


@cache
def robot(free: bool = False) -> Robot:
    """Return the robot model published in 2014; arm motors that take no part in learning have their home in the middle of their range.

    `free`: leave out the clauses, which are the constraints that the shoulder's cables impose.  Every call returns the same object.
    """
    loaded = mobee.load_robot(ROBOT)
    motors = tuple(replace(m, home=float(m.limits.mean())) if _is_idle(m) else m for m in loaded.motor_table)
    return replace(loaded, motor_table=motors, clauses=() if free else loaded.clauses)


def _is_idle(motor: Motor) -> bool:
    return motor.part.endswith("_arm") and motor.name not in (*LEFT, *RIGHT)


def arm_plant(
    seed: int, free: bool = False, world: World | None = None, gains: Gains | None = None, motors: MotorParameters | None = None
) -> OfflinePlant:
    """Return a plant of the robot published in 2014, in which only the four motors of the left arm move.

    `seed`: seed of the plant's random numbers.  `free`: there are no cable constraints, and contacts exert no forces.  `world`: objects
    around the robot; None: an empty world.  `gains`, `motors`: gains of the control law and motor parameters; None: the published ones.
    """
    law = Gains.published_2014() if gains is None else gains
    return OfflinePlant(Model(robot(free), world), seed, law, motors, DT, contact_forces=not free, active=LEFT)


def table_world(ghost: bool = False) -> World:
    """Return a new world with only the table, 50 cm thick, its top at z = -0.10 m; `ghost`: the table exerts no force."""
    world = mobee.load_world("table")
    world.remove("ball")
    if ghost:
        world.set_role("table", "ghost")
    return world


def table_plant(seed: int, ghost: bool = False, propagate: Literal["tree", "part"] = "tree") -> OfflinePlant:
    """Return a plant at the table in which eleven motors move: three of the torso and four of each arm.

    `seed`: seed of the plant's random numbers.  `ghost`: the table exerts no force; contacts between parts of the robot still do.
    `propagate`: which motors a contact force moves: all from the link down to the base ("tree"), or only those of the link's part ("part").
    """
    law, moving = Gains.published_2014(), (*TORSO, *LEFT, *RIGHT)
    return OfflinePlant(Model(robot(), table_world(ghost)), seed, law, dt=DT, propagate=propagate, active=moving)


def arm_space(
    levels: Sequence[float] = RANK3, neighbours: Neighbours = "equidistant", tie_seed: int = 0, joints: Sequence[str] = LEFT
) -> Lattice:
    """Return a lattice of states over the four joints of an arm.

    `levels`: values of each joint, as shares of its range.  `neighbours`: number of nearest states to which a state has actions, or
    "equidistant": the states one level away along one joint.  `tie_seed`: seed of the choice among equally near states.  `joints`: names of
    the joints, by default those of the left arm.
    """
    return Lattice(robot(), joints, levels, neighbours, tie_seed)


def torso_space(tie_seed: int = 0) -> Lattice:
    """Return the lattice of the torso: 27 states with actions to the 8 nearest states each.

    `tie_seed`: seed of the choice among equally near states.
    """
    return Lattice(robot(), TORSO, RANK3, TORSO_NEIGHBOURS, tie_seed)


def table_agents(plant: OfflinePlant, explorer: str = "curious", seed: int = 0, tie_seed: int = 0, **settings: Any) -> list[CuriousAgent]:
    """Return the agents of torso, left arm and right arm of the experiment at the table; both arms have the same graph.

    `explorer`, `seed`, `settings`: passed to `CuriousAgent`.  `tie_seed`: seed of the random choice of neighbours among equally
    near states.
    """
    arms = [arm_space(RANK3, ARM_NEIGHBOURS, tie_seed, joints) for joints in (LEFT, RIGHT)]
    return [CuriousAgent(space, plant, explorer, seed, **settings) for space in (torso_space(tie_seed), *arms)]


def columns() -> slice:
    """Return the slice of the left arm's four joints in `robot.motors`, to index poses (..., n)."""
    first = robot().parts[PART].start
    return slice(first, first + JOINTS)


def arm_clauses() -> list[Clause]:
    """Return the clauses of the left arm, which are the constraints of the shoulder's cables."""
    return [clause for clause in robot().clauses if clause.part == PART]


@cache
def min_margin() -> float:
    """Return the smallest value of a.q + b [rad] at which a pose counts as clear of a cable constraint.

    The factors a and b are those of `Clause`.
    It is half the width of the zone in which the published control law pushes the arm away from a constraint.  At this value the force
    moves a resting arm by about three degrees.  In the lattice with three levels per joint, this is a quarter of the distance from a state
    to the edge of its cell, the region of poses that are nearest to this state.
    """
    return Gains.published_2014().constraint_width / 2.0


def whole(q: Array) -> Array:
    """Return the poses (..., n) rad of the robot with the left arm's four joints at q (..., 4) rad and all other motors at home."""
    body = robot()
    poses = np.broadcast_to(body.home, (*q.shape[:-1], len(body.home))).copy()
    poses[..., columns()] = q
    return poses


def clear(model: Model, q: Array, clauses: Sequence[Clause]) -> NDArray[np.bool_]:
    """Return which poses q (P, 4) rad of the left arm are clear, (P,): nothing touches, and no cable constraint is near.

    Neither solids nor fields (the larger volumes that cause repulsive forces) may touch.  `model`: the robot in its world.  `clauses`: the
    cable constraints that count; the largest a.q + b [rad] of each must be at least the value that `min_margin` returns.
    """
    poses = whole(q)
    good = np.ones(len(poses), dtype=bool)
    good[model.evaluate(poses).table.pose] = False
    for clause in clauses:
        good &= (poses @ clause.a.T + clause.b).max(axis=1) >= min_margin()
    return good
