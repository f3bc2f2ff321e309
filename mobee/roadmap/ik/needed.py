"""Which motors a search has to draw at random: the others would end up anywhere, for nothing ever moves them back."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from mobee.roadmap.ik.aim_kinds import MOTOR
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.term import Aim
from mobee.robot.robot import Robot

Flags = NDArray[np.bool_]

PROBES = 3  # random poses in which a motor is moved, to see whether a term feels it
_FELT = 1e-9


def needed(problem: Problem, aims: Iterable[Aim]) -> Flags:
    """Of the motors that may move, those (d,) that move an aim or are felt by a term that has none, as a plain function of a finger.

    Contacts do not count: that a finger could touch is no reason to spread it.
    """
    moves = _movers(problem.model.robot, aims)[problem.free]
    others = [one for one in problem.terms if one.aims is None and one.tolerance is not None and one.name != "collision"]
    still = np.flatnonzero(~moves)
    if not others or not len(still):
        return moves
    rng, low, high = np.random.default_rng(0), *problem.limits.T
    drawn = rng.uniform(low, high, (PROBES, 1 + len(still), len(low)))
    drawn[:, 1:] = np.where(np.eye(len(low), dtype=bool)[still], drawn[:, 1:], drawn[:, :1])
    pose = problem.model.evaluate(problem.whole(drawn.reshape(-1, len(low))))
    for one in others:
        said = one.residual(pose).reshape(PROBES, -1)
        moves[still[(np.abs(said[:, 1:] - said[:, :1]) > _FELT).sum(axis=0) > 0]] = True
    return moves


def _movers(robot: Robot, aims: Iterable[Aim]) -> Flags:
    """The motors (n,) before the links of aims, and those that are aims themselves."""
    scale = robot.coupling[0]
    moves = np.zeros(len(robot.motors), dtype=bool)
    for aim in aims:
        if aim.kind == MOTOR:
            moves[aim.motor] = True
        for link in (aim.first_link, aim.second_link):
            while link > 0:
                moves |= scale[link - 1] != 0.0
                link = robot.joints[link - 1].parent
    return moves
