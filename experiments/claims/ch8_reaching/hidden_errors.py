# SPDX-License-Identifier: Apache-2.0
"""An arm and its workspace, with calibration errors and a ball that the planners' model, or every model, does not contain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import permutations

import numpy as np

from experiments.kit.learning.arm import RIGHT
from experiments.kit.reaching.arm import Errors, JudgedPlant, arm_belief, arm_plant, body, space, straight_paths
from experiments.kit.reaching.belief import PeerBelief
from experiments.kit.reaching.targets import grid, touchable, touchable_targets
from mobee import World, sphere
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget

WRONG = ("nothing", "planners", "everyone")
"""Whose model is wrong: nobody's; the planners' alone; also MoBeE's, which has the same wrong encoders and target positions."""
SHIFT, TURN = 0.01, np.deg2rad(3.0)  # m and rad, errors of the believed target positions and joint angles
UNSEEN = "unseen"  # name of the hidden ball
RADIUS = 0.05  # m, of the hidden ball
TARGET_CLEARANCE = 0.12  # m, least distance of the ball's centre from the centre of any target of the thesis
MIN_BLOCKED, MAX_BLOCKED = 0.08, 0.3  # share of the straight paths between two states that the ball blocks
DRAWS = 400  # positions of the ball that are tried


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Targets as MoBeE sees them, the ball's position (3,) m, and the errors of joints `turns` (4,) rad and targets `shift` (3,) m."""

    targets: list[ReachTarget]
    ball: Array
    turns: Array
    shift: Array
    wrong: str

    def plant(self, seed: int, ball: bool = True) -> JudgedPlant:
        """Return the true arm, with or without the ball."""
        turns = np.zeros(len(body().motors))
        turns[[body().motor_index(name) for name in RIGHT]] = self.turns
        errors = Errors(turns, self.shift) if self.wrong == "everyone" else None
        return JudgedPlant(arm_plant(seed, _world(self.ball) if ball else None), errors, [UNSEEN])

    def belief(self) -> PeerBelief:
        """Return the planners' model of the arm and the workspace."""
        if self.wrong == "nothing":
            return arm_belief(_world(self.ball))
        return arm_belief(cables=False, turns=self.turns if self.wrong == "planners" else None)

    def seen(self, target: ReachTarget) -> ReachTarget:
        """Return a target at the position that the planners believe."""
        return replace(target, position=target.position + self.shift) if self.wrong == "planners" else target


def make_scene(seed: int, wrong: str) -> Scene:
    """Draw a ball that blocks motions, and errors of the sizes above; they are the same for every `wrong`.

    Targets of `touchable_targets` that cannot be touched because of the ball are left out.
    """
    return replace(_drawn(seed), wrong=wrong)


@cache
def _drawn(seed: int) -> Scene:
    rng = np.random.default_rng([seed, 86])
    ball = _ball(rng, grid())
    shift = rng.normal(size=3)
    knowing = arm_belief(_world(ball))
    targets = [target for target in touchable_targets() if touchable(knowing, target)]
    return Scene(targets, ball, TURN * rng.choice([-1.0, 1.0], size=len(RIGHT)), SHIFT * shift / np.linalg.norm(shift), WRONG[0])


def _world(ball: Array) -> World:
    world = World()
    world.add(UNSEEN, sphere(RADIUS), position=ball)
    return world


def _ball(rng: np.random.Generator, targets: Array) -> Array:
    """Return a position of the palm, away from the targets and from the robot at home, at which a ball blocks some motions."""
    low, high = body().limits[[body().motor_index(name) for name in RIGHT]].T
    pairs = list(permutations(range(len(space())), 2))
    chosen = [pairs[i] for i in rng.permutation(len(pairs))[:100]]
    paths = straight_paths(chosen).reshape(-1, len(RIGHT))
    alone = arm_belief()
    before = 1.0 - alone.sound(paths).reshape(len(chosen), -1).all(axis=1).mean()
    for _ in range(DRAWS):
        q = rng.uniform(low, high)
        place = alone.model.evaluate(alone.whole(q)).position(alone.marker)
        if np.linalg.norm(targets - place, axis=1).min() < TARGET_CLEARANCE:
            continue
        belief = arm_belief(_world(place))
        if len(belief.model.evaluate(body().home).table):
            continue
        blocked = 1.0 - belief.sound(paths).reshape(len(chosen), -1).all(axis=1).mean()
        if MIN_BLOCKED <= blocked - before <= MAX_BLOCKED:
            found: Array = place
            return found
    raise InvalidValue(f"no position for the ball was found in {DRAWS} draws: use another seed.")
