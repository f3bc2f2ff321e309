"""The problem of thesis 1.5: both arms, twelve joints, around the edge of a table to a cup.

No drawing of it was published; here both hands begin beside the table, below its top or just above it, and end on both sides of the cup.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from experiments.kit.control.plant_runs import place
from experiments.kit.reaching.arm import body
from experiments.kit.reaching.belief import PeerBelief, approach, rrt_connect, shortened
from mobee import Gains, Model, OfflinePlant, World, box, cylinder
from mobee.arrays import Array
from mobee.errors import InvalidValue

JOINTS = 6  # of each arm: all but the last of the wrist
SIDES = {"right_arm": 1.0, "left_arm": -1.0}
EDGE, WIDE, TOP = -0.14, 0.36, 0.0  # m: where the table begins, how wide it is, and its height in the root frame
CUP = np.array([-0.3, 0.0, 0.05])  # m, its middle
GRIP = np.array([0.0, 0.08, 0.05])  # m, from there to the right palm; the left one is mirrored
BESIDE, BELOW = 0.22, 0.03  # m: where hands begin, from the middle and above the top
DRAWS, PAIRS, ENDS = 20_000, 4_000, 8
EXTENSIONS = 20_000
NEAR = 0.02  # m


@dataclass(frozen=True, slots=True)
class Query:
    """The result of a query: whether a path was found, s of processor time to find and to shorten it, its corners, the palms' error [m]."""

    found: bool
    seconds: float
    smoothing: float
    corners: int
    missing: float


def query(seed: int) -> Query:
    """Draw where the hands begin, plan a path, and follow it through MoBeE."""
    rng = np.random.default_rng([seed, 15])
    model = Model(body(), table_and_cup())
    both = _belief(model, tuple(SIDES))
    starts = _sound(both, [_beside(part, rng) for part in SIDES], rng)
    ends = _sound(both, [_at_cup(part, rng) for part in SIDES], rng)[:ENDS]
    begun = time.process_time()
    path = rrt_connect(both, starts[0], ends, seed, extensions=EXTENSIONS)
    seconds = time.process_time() - begun
    if path is None:
        return Query(False, seconds, 0.0, 0, np.inf)
    begun = time.process_time()
    path = shortened(both, path, rng)
    smoothing = time.process_time() - begun
    return Query(True, seconds, smoothing, len(path), _followed(both, path, seed))


def table_and_cup() -> World:
    """The world with the table and the cup."""
    world = World()
    world.add("table", box(0.6, WIDE, 0.5), position=(EDGE - 0.3, 0.0, TOP - 0.25))
    world.add("cup", cylinder(0.03, 0.1), position=CUP)
    return world


def _belief(model: Model, parts: tuple[str, ...]) -> PeerBelief:
    robot = model.robot
    motors = [name for part in parts for name in robot.parts[part].motors[:JOINTS]]
    clauses = [clause for clause in robot.clauses if clause.part in parts]
    return PeerBelief(model, motors, f"{parts[0].removesuffix('_arm')}_palm", clauses, Gains.default())


def _beside(part: str, rng: np.random.Generator) -> Array:
    """Poses of an arm (K, 6) rad with the hand beside the table and low."""
    belief = _belief(Model(body()), (part,))
    q = rng.uniform(belief.limits[:, 0], belief.limits[:, 1], (DRAWS, JOINTS))
    palm = belief.model.evaluate(belief.whole(q)).position(belief.marker)
    q = q[(SIDES[part] * palm[:, 1] > BESIDE) & (palm[:, 2] < TOP + BELOW)]
    found: Array = q[belief.sound(q)]
    return found


def _at_cup(part: str, rng: np.random.Generator) -> Array:
    """Poses of an arm (K, 6) rad with the palm beside the cup."""
    belief = _belief(Model(body()), (part,))
    grip = CUP + GRIP * (1.0, SIDES[part], 1.0)
    starts = rng.uniform(belief.limits[:, 0], belief.limits[:, 1], (256, JOINTS))
    q, missing = approach(belief, starts, grip, 0.0, belief.limits)
    q = q[missing < NEAR / 10.0]
    found: Array = q[belief.sound(q)]
    return found


def _sound(both: PeerBelief, arms: list[Array], rng: np.random.Generator) -> Array:
    """Poses of both arms (K, 12) rad, in the world; raises InvalidValue if none is found."""
    if all(len(arm) for arm in arms):
        pairs = np.concatenate([arm[rng.integers(len(arm), size=PAIRS)] for arm in arms], axis=1)
        found: Array = pairs[both.sound(pairs)]
        if len(found):
            return found
    raise InvalidValue("no pose of both arms was found: take another seed.")


def _followed(both: PeerBelief, path: Array, seed: int) -> float:
    """Follow the corners with both arms; the larger distance of a palm from its place at the last corner, m."""
    plant = OfflinePlant(Model(body(), table_and_cup()), seed, active=tuple(body().motors[i] for i in both.columns))
    place(plant, both.whole(path[0]))
    for corner in path[1:]:
        whole = both.whole(corner)
        for part in SIDES:
            plant.begin(part, whole[body().parts[part].slice])
        waiting = set(SIDES)
        while waiting:
            waiting -= {part for part, _ in plant.advance()}
    there = plant.model.evaluate(np.concatenate([plant.measure(part) for part in body().parts]))
    aim = both.model.evaluate(both.whole(path[-1]))
    palms = [f"{part.removesuffix('_arm')}_palm" for part in SIDES]
    return max(float(np.linalg.norm(there.position(palm) - aim.position(palm))) for palm in palms)
