"""The right arm that reaches: robot, laws, states, plants, what is learned of its transitions, and what a planner believes of it.

The four joints of the published lattice move; the wrist and the fingers are rigid at home.  `reach_space`, `reach_plant` and
`learned_beliefs` are the published set-up (thesis 8.3): the robot of 2014, under either law, with equidistant neighbours.  The functions
with a `law` belong to the experiments that compare with planners: today's robot under the default law, or that of 2014 under the published
one, with the 16 nearest states as neighbours.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

import mobee
from experiments.kit.learning.arm import ARM_NEIGHBOURS, DT, RANK3, RIGHT, arm_space
from experiments.kit.learning.arm import robot as published_robot
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.reaching.belief import PeerBelief
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, TransitionModel, World
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.value_iteration import OutcomeModel
from mobee.plant import Outcome
from mobee.reach import Aim, ReachOutcome, ReachPlant, ReachTarget
from mobee.robot.robot import Robot

PART, MARKER = "right_arm", "right_palm"
LEARNED = 3000  # curious transitions, after which the lattice was known (thesis 7.2.2: 2987)


@dataclass(frozen=True)
class Law:
    """The gains and the time step of a control law, and where its reaches bring the palm: to the target's "centre" or its "surface"."""

    gains: Gains
    dt: float
    aim: Aim


@cache
def laws() -> dict[str, Law]:
    """The published law, whose reaches pull against the attractor; and ours, whose reaches arrive at the target."""
    return {"published": Law(Gains.published_2014(), DT, "centre"), "default": Law(Gains.default(), 0.01, "surface")}


@cache
def reach_space() -> Lattice:
    """81 states of the right arm's four joints, with equidistant neighbours: 432 actions."""
    return arm_space(RANK3, joints=RIGHT)


def reach_plant(seed: int, law: str = "published") -> OfflinePlant:
    """The four motors of the right arm, in an empty world."""
    chosen = laws()[law]
    return OfflinePlant(Model(published_robot()), seed, chosen.gains, dt=chosen.dt, active=RIGHT)


def learned_beliefs(plant: OfflinePlant, seed: int, transitions: int = LEARNED) -> OutcomeModel:
    """The outcomes of the transitions, as a curious agent learns them without a target; reaching does not change them (thesis 8.1)."""
    space = reach_space()
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed)
    explore(agent, transitions)
    return agent.model.debiased()


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
    """The belief of a planner: a world, the cables' constraints if it knows them, joint offsets `turns` (4,) rad."""
    clauses = [clause for clause in body(law).clauses if clause.part == PART] if cables else []
    return PeerBelief(Model(body(law), world), RIGHT, MARKER, clauses, laws()[law].gains, turns)


def learned_transitions(plant: OfflinePlant, seed: int, transitions: int = LEARNED, law: str = "default") -> TransitionModel:
    """The transition model of a curious agent, learned while no target is presented."""
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


def straight_paths(pairs: Sequence[tuple[int, int]], points: int = 21) -> Array:
    """Poses of the motors on the straight paths between states: (pairs, points, 4) rad."""
    samples, shares = space().samples, np.linspace(0.0, 1.0, points)[:, None]
    found: Array = np.array([samples[a] + shares * (samples[b] - samples[a]) for a, b in pairs])
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Calibration errors: true minus measured motor angles (n,) rad, and true minus seen target positions (3,) m."""

    turns: Array
    shift: Array


class JudgedPlant:
    """An offline plant with wrong encoders and eyes: control follows them, but the result of a reach is measured in the true poses.

    Args:
        plant: which is driven.
        errors: of its encoders and eyes.
        unseen: names of world objects that outcomes do not report.
    """

    def __init__(self, plant: OfflinePlant, errors: Errors | None = None, unseen: Collection[str] = ()) -> None:
        self.inner, self.robot, self.model = plant, plant.robot, plant.model
        n = len(plant.robot.motors)
        self.errors = Errors(np.zeros(n), np.zeros(3)) if errors is None else errors
        self._unseen = frozenset(unseen)
        self._target: ReachTarget | None = None

    @property
    def time(self) -> float:
        """Plant time in s."""
        return self.inner.time

    @property
    def settings(self) -> dict[str, Any]:
        """See Described."""
        errors = {"turns": self.errors.turns.tolist(), "shift": self.errors.shift.tolist()}
        return self.inner.settings | {"errors": errors, "unseen": sorted(self._unseen)}

    @property
    def q(self) -> Array:
        """See Plant."""
        return self.inner.q

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        return self._reported(self.inner.act(part, target))

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """As `act`, but the target exerts no force on the marker's hand, as in a reach: the planner has planned around it."""
        return self._reported(self.inner.act(part, target, reaching=marker))

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant; the target where it is seen."""
        self._target = target
        self.inner.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """See ReachPlant; with the true position of the marker at the end of the force, and the true remaining error."""
        found = self.inner.reach(part, marker, stay)
        where = self.marker_at(marker, part, found.q)
        return replace(
            found, marker=where, missing=self._true.missing(where), touched=self._seen(found.touched), after=self._reported(found.after)
        )

    def missing(self, marker: str) -> float:
        """The true distance of the marker from the target, now; m."""
        return self._true.missing(self.marker_at(marker))

    def marker_at(self, marker: str, part: str | None = None, q: Array | None = None) -> Array:
        """The true position of the marker, (3,) m: now, or with the part's motors at encoder readings q (n_part,) rad."""
        whole = self.inner.q
        if part is not None and q is not None:
            whole[self.robot.part(part).slice] = q
        found: Array = self.model.evaluate(whole + self.errors.turns).position(marker)
        return found

    @property
    def _true(self) -> ReachTarget:
        if self._target is None:
            raise InvalidValue("no target is presented; call present(ReachTarget(position)) first")
        return replace(self._target, position=self._target.position + self.errors.shift)

    def _reported(self, outcome: Outcome) -> Outcome:
        return replace(outcome, touched=self._seen(outcome.touched))

    def _seen(self, touched: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in touched if name not in self._unseen)
