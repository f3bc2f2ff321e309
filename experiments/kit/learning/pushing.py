# SPDX-License-Identifier: Apache-2.0
"""The left arm of the iCub beside a cup on the table: postures, grid, plant and agent of experiments in which the arm pushes the cup."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

import mobee
from mobee import CuriousAgent, Grid, Model, ObjectSpace, OfflinePlant, PerceivingPlant, Planner, SlidingObject, Space, World
from mobee.arrays import Array
from mobee.learning.neighbours import equidistant_goals, lattice_digits
from mobee.learning.value_iteration import OutcomeModel
from mobee.plant import present_outcome
from mobee.robot.robot import Robot

PART, JOINTS = "left_arm", ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow")
DT = 0.02  # s
CUP, RADIUS, HEIGHT = "cup", 0.035, 0.09  # m: the cup of the world `things`
FRICTION = 0.3  # with the table; above RADIUS / HEIGHT the hand would topple the cup where it touches it high
TABLE_TOP = -0.10  # m
PALM_HEIGHT = 0.08  # m above the table: the lowest of the hand is 1 to 4 cm above it
NOISE = 0.003  # m, standard deviation of a perceived place along x and y: of calibrated cameras (docs/vision.md)
DETECTOR = "run_length"  # where the cup stands in its cell is hidden, so that outcomes change without a visible cause


@dataclass(frozen=True)
class Arrangement:
    """An arrangement of postures, grid and cup, in m, root frame.

    `palm_x`, `palm_y`: there is a posture with the palm at each pair of them.  `shape`: number of cells of the grid along x and y.  `cup`:
    first place of the cup (x, y).  `x`, `y`: lowest and highest coordinate of the grid.
    """

    palm_x: tuple[float, ...]
    palm_y: tuple[float, ...]
    shape: tuple[int, int]
    cup: tuple[float, float]
    x: tuple[float, float] = (-0.41, -0.26)
    y: tuple[float, float] = (-0.25, -0.01)

    @property
    def grid(self) -> Grid:
        """The grid of cells; the cup is put back to its first place when it leaves the grid."""
        return Grid(self.x, self.y, self.shape)

    @property
    def goals(self) -> list[int]:
        """The indices of the cells to which the cup is to be pushed.

        These are all cells but the first cell of the cup and the cells nearest to the body, to which no hand can pull the cup.
        """
        grid = self.grid
        return [cell for cell in range(len(grid)) if cell != grid.cell_of(self.cup) and cell % self.shape[0] < self.shape[0] - 1]


_Y = (-0.30, -0.215, -0.13, -0.045, 0.04)
ARRANGEMENTS: Mapping[str, Arrangement] = {
    "nine cells": Arrangement((-0.20, -0.255, -0.31), _Y, (3, 3), (-0.335, -0.13)),
    "nearer postures": Arrangement((-0.20, -0.25, -0.30), (-0.29, -0.21, -0.13, -0.05, 0.03), (3, 3), (-0.335, -0.13)),
    "twelve cells": Arrangement((-0.20, -0.255, -0.31), _Y, (3, 4), (-0.335, -0.16)),
}


@cache
def robot() -> Robot:
    """Return the iCub; every call returns the same object."""
    return mobee.load_robot("icub")


def _table() -> World:
    world = mobee.load_world("table")
    world.remove("ball")
    return world


@cache
def postures(x: tuple[float, ...], y: tuple[float, ...]) -> Space:
    """Return the lattice of left-arm postures with the palm at each pair of x and y [m, root frame], 8 cm above the table.

    Where the arm does not reach such a place, the palm is as near as possible.  Each action changes x or y by one step.
    """
    body, model = robot(), Model(robot(), _table())
    columns = [body.motor_index(name) for name in JOINTS]
    samples = [_posture(model, (at_x, at_y, TABLE_TOP + PALM_HEIGHT))[columns] for at_y in y for at_x in x]
    sizes = len(x), len(y)
    low, high = body.limits[body.parts[PART].slice].T
    rest = ((body.home[body.parts[PART].slice] - low) / (high - low)).tolist()
    return Space(body, JOINTS, samples, equidistant_goals(lattice_digits(sizes), sizes), rest)


def _posture(model: Model, palm: tuple[float, float, float]) -> Array:
    wanted = [mobee.costs.position("left_palm", palm), mobee.costs.comfort(0.1)]
    return mobee.solve_ik(model, wanted, seed=0, motors=JOINTS).q


class Stage:
    """An arm, a cup that it pushes, and an agent that learns how its actions move the cup.

    The agent perceives the cup at the place that the function `source` returns, with random errors.  At first this is the cup's true place;
    an experiment may replace the function, so that the agent perceives something else as the cup.

    Args:
        arrangement: postures, grid and first place of the cup.
        seed: of the random numbers of the plant, of the errors of perceived places, and of the agent.
        explorer: name of the rule by which the agent chooses its actions, such as "curious".
    """

    def __init__(self, arrangement: Arrangement, seed: int, explorer: str) -> None:
        world, place = _table(), (*arrangement.cup, TABLE_TOP + HEIGHT / 2.0)
        world.add(CUP, mobee.cylinder(RADIUS, HEIGHT), position=place, role="ghost")
        self._arm = OfflinePlant(Model(robot(), world), seed, dt=DT, active=JOINTS)
        self.cup = SlidingObject(self._arm, CUP, friction=FRICTION, area=(arrangement.x, arrangement.y))
        self.source: Callable[[], Array | None] = lambda: self.cup.place
        """Function that returns the place (3,) m at which the agent perceives the cup, None if it does not; at first the true place."""
        self._errors = np.random.default_rng([seed, 2107])
        self.plant = PerceivingPlant(self._arm, self._perceive)
        self.space = ObjectSpace(postures(arrangement.palm_x, arrangement.palm_y), arrangement.grid, CUP)
        self.agent = CuriousAgent(self.space, self.plant, explorer, seed, detector=DETECTOR)

    def _perceive(self) -> dict[str, Array]:
        place = self.source()
        return {} if place is None else {CUP: place[:2] + self._errors.normal(0.0, NOISE, 2)}


def push_to(stage: Stage, goals: Sequence[int], tries: int, most: int, beliefs: OutcomeModel | None, seed: int) -> list[bool]:
    """Try to push the cup from its first place to goal cells, by planned or random actions; return the success of each try.

    A try is a success if the cup is perceived in the goal cell after one of at most `most` actions.

    Args:
        stage: arm, cup and agent.
        goals: indices of the goal cells; the tries use them in turn: try i, counted from 0, has goals[i % len(goals)].
        tries: number of tries.
        most: largest number of actions of a try.
        beliefs: transition model for the plans; None: all actions are random.  Where the plan finds no action that leads to the goal, the
            action is random, too.
        seed: of the random actions.
    """
    space, rng, reached = stage.space, np.random.default_rng([seed, 7]), list[bool]()
    planners = {} if beliefs is None else {goal: Planner(space, beliefs, space.in_cell(goal)) for goal in goals}
    for number in range(tries):
        goal = goals[number % len(goals)]
        state = _begin(stage, rng)
        for _ in range(most):
            planner = planners.get(goal)
            if planner is not None and planner.values[state] > 0.0:
                action = int(planner.policy[state])
            else:
                action = int(rng.integers(len(space.actions(state))))
            state = space.state_after(stage.plant.act(PART, space.aim(state, action)), state)
            if space.cell(state) == goal:
                break
        reached.append(space.cell(state) == goal)
    return reached


def _begin(stage: Stage, rng: np.random.Generator) -> int:
    """Move the arm to random postures until the cup can stand at its first place; returns the index of the present state of stage.space."""
    while True:
        stage.plant.act(PART, stage.space.postures.target(int(rng.integers(len(stage.space.postures)))))
        if stage.cup.put_back():
            return stage.space.state_after(present_outcome(stage.plant, PART))
