"""An arm and its workspace, with the errors and the ball that are hidden from planners, or from all (`reach-under-model-error`)."""

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
"""Whose knowledge is wrong: nobody's; the planners' alone; also MoBeE's, which sees the same wrong encoders and targets."""
SHIFT, TURN = 0.01, np.deg2rad(3.0)  # m and rad by which targets and joints differ from what is believed
UNSEEN = "unseen"
RADIUS = 0.05  # m, of the hidden ball
AWAY = 0.12  # m, from its middle to that of any of the thesis' targets
LEAST, MOST = 0.08, 0.3  # share of the straight paths between two states that it blocks
DRAWS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Targets where they are seen, the place of the ball (3,) m, and by how much joints and targets are off: (4,) rad, (3,) m."""

    targets: list[ReachTarget]
    ball: Array
    turns: Array
    shift: Array
    wrong: str

    def plant(self, seed: int, ball: bool = True) -> JudgedPlant:
        """The true arm, with or without the ball."""
        turns = np.zeros(len(body().motors))
        turns[[body().motor_index(name) for name in RIGHT]] = self.turns
        errors = Errors(turns, self.shift) if self.wrong == "everyone" else None
        return JudgedPlant(arm_plant(seed, _world(self.ball) if ball else None), errors, [UNSEEN])

    def belief(self) -> PeerBelief:
        """The belief of its planners."""
        if self.wrong == "nothing":
            return arm_belief(_world(self.ball))
        return arm_belief(cables=False, turns=self.turns if self.wrong == "planners" else None)

    def seen(self, target: ReachTarget) -> ReachTarget:
        """A target where its planners believe it to be."""
        return replace(target, position=target.position + self.shift) if self.wrong == "planners" else target


def make_scene(seed: int, wrong: str) -> Scene:
    """A ball that blocks many motions, and errors of the sizes above; they are the same for every `wrong`.

    Targets of `touchable_targets` that cannot be touched beside the ball are left out.
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
    """A place of the palm, away from the targets and from the robot at home, at which a ball blocks some motions."""
    low, high = body().limits[[body().motor_index(name) for name in RIGHT]].T
    pairs = list(permutations(range(len(space())), 2))
    chosen = [pairs[i] for i in rng.permutation(len(pairs))[:100]]
    paths = straight_paths(chosen).reshape(-1, len(RIGHT))
    alone = arm_belief()
    before = 1.0 - alone.sound(paths).reshape(len(chosen), -1).all(axis=1).mean()
    for _ in range(DRAWS):
        q = rng.uniform(low, high)
        place = alone.model.evaluate(alone.whole(q)).position(alone.marker)
        if np.linalg.norm(targets - place, axis=1).min() < AWAY:
            continue
        belief = arm_belief(_world(place))
        if len(belief.model.evaluate(body().home).table):
            continue
        blocked = 1.0 - belief.sound(paths).reshape(len(chosen), -1).all(axis=1).mean()
        if LEAST <= blocked - before <= MOST:
            found: Array = place
            return found
    raise InvalidValue(f"no place for the ball in {DRAWS} draws: leave this seed out.")
