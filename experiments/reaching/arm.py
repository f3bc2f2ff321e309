"""The right arm, today's under the default law or that of 2014 under the published one: states, plant, and what a planner knows of it.

The four joints of the published lattice move, the wrist and the fingers are rigid at home.  A try succeeds if the palm comes within 2 cm
of the surface of a target of 10 cm.  scene.py has what was published: the robot of 2014 under either law, and equidistant neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

import mobee
from experiments.kit.arm_learning import ARM_NEIGHBOURS, RANK3, RIGHT
from experiments.kit.arm_learning import robot as published_robot
from experiments.reaching.peer_belief import PeerBelief
from experiments.reaching.peer_goals import goals
from experiments.reaching.scene import LEARNED, MARKER, PART, laws
from experiments.reaching.targets import grid, targets_at
from mobee import CuriousAgent, Lattice, Model, MotorParameters, OfflinePlant, TransitionModel, World
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import ReachPlant, ReachTarget
from mobee.robot.robot import Array, Robot

TARGETS = 27
PREDICTOR, STRATEGY = "gp", "ucb"


@cache
def body(law: str = "default") -> Robot:
    """Today's robot; that of 2014 for the published law."""
    return published_robot() if law == "published" else mobee.load_robot("icub")


@cache
def space(law: str = "default") -> Lattice:
    """81 states, with the 16 nearest as neighbours."""
    return Lattice(body(law), RIGHT, RANK3, ARM_NEIGHBOURS)


@cache
def hands(law: str = "default") -> Array:
    """Where the palm is in each state, (S, 3) m, root frame: the wrist is rigid at home, and not at rest as in the space's targets."""
    found: Array = Model(body(law)).evaluate(_poses(law)).position(MARKER)
    return found


@cache
def jacobians(law: str = "default") -> Array:
    """How the joints move the palm in each state, (S, 3, 4) m/rad."""
    return Model(body(law)).jacobian(_poses(law), MARKER)[:, :3, _motors(law)]


def _poses(law: str) -> Array:
    """All motors in each state, (S, n) rad: those that do not move at home."""
    poses = np.tile(body(law).home, (len(space(law)), 1))
    poses[:, _motors(law)] = space(law).samples
    return poses


def _motors(law: str) -> list[int]:
    return [body(law).motor_index(name) for name in RIGHT]


def arm_plant(seed: int, world: World | None = None, motors: MotorParameters | None = None, law: str = "default") -> OfflinePlant:
    """The plant; `motors`: None for the usual ones."""
    chosen = laws()[law]
    return OfflinePlant(Model(body(law), world), seed, chosen.gains, motors, chosen.dt, active=RIGHT)


def arm_belief(world: World | None = None, cables: bool = True, turns: Array | None = None, law: str = "default") -> PeerBelief:
    """What a planner believes: a world, the rows of the cables if it knows them, joints that stand `turns` (4,) rad elsewhere."""
    clauses = [clause for clause in body(law).clauses if clause.part == PART] if cables else []
    return PeerBelief(Model(body(law), world), RIGHT, MARKER, clauses, laws()[law].gains, turns)


def learned_transitions(plant: OfflinePlant, seed: int, transitions: int = LEARNED, law: str = "default") -> TransitionModel:
    """What a curious agent learns of the transitions while nothing is presented."""
    agent = CuriousAgent(space(law), plant, seed=seed)
    agent.run(transitions)
    return agent.model


def reach_agent(plant: ReachPlant, model: TransitionModel, seed: int, law: str = "default") -> ReachAgent:
    """The learner: the shipped predictor, the model learned on (thesis 9.4.1); failures count where they were, as for the planner peer."""
    return ReachAgent(
        space(law),
        plant,
        marker=MARKER,
        predictor=PREDICTOR,
        strategy=STRATEGY,
        failures="local",
        model=model,
        hands=hands(law),
        jacobians=jacobians(law),
        seed=seed,
    )


@cache
def touchable_targets(law: str = "default", free: bool = True) -> tuple[ReachTarget, ...]:
    """TARGETS that the palm can touch in an empty world: those of the thesis' 27, and others drawn between them.

    So that no solid but the hand's is in the target, cables hold, and, if `free`, no joint limit pushes.
    """
    belief, rng, places, aim = arm_belief(law=law), np.random.default_rng(27), grid(), laws()[law].aim
    found = [target for target in targets_at(places, aim) if touchable(belief, target, free)]
    while len(found) < TARGETS:
        target = targets_at(rng.uniform(places.min(axis=0), places.max(axis=0))[None], aim)[0]
        found += [target] if touchable(belief, target, free) else []
    return tuple(found)


def touchable(belief: PeerBelief, target: ReachTarget, free: bool = True) -> bool:
    """Whether, of all that is believed, the palm can touch a target; `free`: where no joint limit pushes."""
    to_surface = replace(target, aim="surface")
    belief.present(to_surface)
    return len(goals(belief, to_surface, np.random.default_rng(0), most=1, free=free)[0]) > 0


def straight_ways(pairs: Sequence[tuple[int, int]], looks: int = 21) -> Array:
    """Poses of the motors on the straight ways between states: (pairs, looks, 4) rad."""
    samples, shares = space().samples, np.linspace(0.0, 1.0, looks)[:, None]
    found: Array = np.array([samples[a] + shares * (samples[b] - samples[a]) for a, b in pairs])
    return found
