"""The right arm of today's robot under the default law: its states, its plant, and what a planner knows of it.

The four joints of the published lattice move, the wrist and the fingers are rigid at home.  A try succeeds if the palm comes within 2 cm
of the surface of a target of 10 cm.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

import mobee
from experiments.learning.published import ARM_NEIGHBOURS, RANK3, RIGHT
from experiments.reaching.peer_belief import PeerBelief
from experiments.reaching.peer_goals import goals
from experiments.reaching.targets import grid, targets_at
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, TransitionModel, World
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import ReachPlant, ReachTarget
from mobee.robot.robot import Array, Robot

PART, MARKER = "right_arm", "right_palm"
GOOD = 0.02  # m from the surface
TARGETS = 27
LEARNED = 3000  # curious transitions before the first target (thesis 7.2.2: 2987)
PREDICTOR, STRATEGY = "gp", "ucb"


@cache
def body() -> Robot:
    """The robot."""
    return mobee.load_robot("icub")


@cache
def space() -> Lattice:
    """81 states, with the 16 nearest as neighbours."""
    return Lattice(body(), RIGHT, RANK3, ARM_NEIGHBOURS)


@cache
def hands() -> Array:
    """Where the palm is in each state, (S, 3) m, root frame."""
    home = np.tile(body().home, (len(space()), 1))
    home[:, [body().motor_index(name) for name in RIGHT]] = space().samples
    found: Array = Model(body()).evaluate(home).position(MARKER)
    return found


def arm_plant(seed: int, world: World | None = None, motors: MotorParameters | None = None) -> OfflinePlant:
    """The plant; `motors`: None for the usual ones."""
    return OfflinePlant(Model(body(), world), seed, motors=motors, active=RIGHT)


def arm_belief(world: World | None = None, cables: bool = True, turns: Array | None = None) -> PeerBelief:
    """What a planner believes: a world, the rows of the cables if it knows them, joints that stand `turns` (4,) rad elsewhere."""
    clauses = [clause for clause in body().clauses if clause.part == PART] if cables else []
    return PeerBelief(Model(body(), world), RIGHT, MARKER, clauses, Gains.default(), turns)


def learned_transitions(plant: OfflinePlant, seed: int, transitions: int = LEARNED) -> TransitionModel:
    """What a curious agent learns of the transitions while nothing is presented."""
    agent = CuriousAgent(space(), plant, seed=seed)
    agent.run(transitions)
    return agent.model


def reach_agent(plant: ReachPlant, model: TransitionModel, seed: int) -> ReachAgent:
    """The learner: the shipped predictor, failures remembered locally, the model learned on (thesis 9.4.1)."""
    return ReachAgent(
        space(),
        plant,
        marker=MARKER,
        predictor=PREDICTOR,
        strategy=STRATEGY,
        failures="local",
        model=model,
        hands=hands(),
        seed=seed,
    )


@cache
def reachable() -> tuple[ReachTarget, ...]:
    """TARGETS that the palm can touch in an empty world: those of the thesis' 27, and others drawn between them.

    So that neither cables nor joint limits push, and no solid but the hand's is in the target.
    """
    belief, rng = arm_belief(), np.random.default_rng(27)
    places = grid()
    found = [target for target in targets_at(places, "surface") if touchable(belief, target)]
    while len(found) < TARGETS:
        target = targets_at(rng.uniform(places.min(axis=0), places.max(axis=0))[None], "surface")[0]
        found += [target] if touchable(belief, target) else []
    return tuple(found)


def touchable(belief: PeerBelief, target: ReachTarget) -> bool:
    """Whether, of all that is believed, the palm can touch a target where nothing pushes."""
    belief.present(target)
    return len(goals(belief, target, np.random.default_rng(0), most=1, free=True)[0]) > 0


def straight_ways(pairs: Sequence[tuple[int, int]], looks: int = 21) -> Array:
    """Poses of the motors on the straight ways between states: (pairs, looks, 4) rad."""
    samples, shares = space().samples, np.linspace(0.0, 1.0, looks)[:, None]
    found: Array = np.array([samples[a] + shares * (samples[b] - samples[a]) for a, b in pairs])
    return found
