# SPDX-License-Identifier: Apache-2.0
"""Common functions of the experiments in which the right arm reaches: robot, control laws, lattices, plants and transition models.

The four joints of the published lattice (the discrete states of the arm) move; the wrist and the fingers are rigid at home.  `reach_space`,
`reach_plant` and `learned_beliefs` are the published set-up (thesis 8.3): the robot of 2014, under the published or the default law, with
actions to the states one level away along one joint.  The functions with an argument `law` (except `reach_plant`) belong to the experiments
that compare with planners: today's robot under the law "default", or the robot of 2014 under the law "published", with actions to the 16
nearest states.  `JudgedSeeingPlant` sees its hand, and so corrects its encoders, while its reaches are judged by the true position.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol

import numpy as np

import mobee
from experiments.kit.learning.arm import ARM_NEIGHBOURS, DT, RANK3, RIGHT, arm_space
from experiments.kit.learning.arm import robot as published_robot
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.plants import WrappedPlant
from experiments.kit.reaching.belief import PeerBelief
from experiments.kit.reaching.learning import LEARNERS
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, TransitionModel, World
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.value_iteration import OutcomeModel
from mobee.plant import Outcome
from mobee.reach import Aim, ReachOutcome, ReachPlant, ReachTarget
from mobee.robot.robot import Robot
from mobee.vision.calibration.self_calibration import NOISE, JointOffsets, SelfCalibratingPlant

PART, MARKER = "right_arm", "right_palm"
TRANSITIONS = 3000  # curious ones, enough to learn the lattice (thesis 7.2.2: 2987)


@dataclass(frozen=True)
class Law:
    """A control law, its period and the aim of reaches; in a reach, a force pulls the palm to a target.

    `gains`: gains of the law.  `dt`: control period, s.  `aim`: whether the force pulls to the "centre" or the "surface" of the target.
    """

    gains: Gains
    dt: float
    aim: Aim


@cache
def laws() -> dict[str, Law]:
    """Return a dict from "published" and "default" to these two control laws.

    Under the published law the attractor (the commanded posture) stays at its place during a reach and pulls against the force of the
    reach; under the default law the marker (the palm) arrives at the target.
    """
    return {"published": Law(Gains.published_2014(), DT, "centre"), "default": Law(Gains.default(), 0.01, "surface")}


@cache
def reach_space() -> Lattice:
    """Return the lattice of the right arm's four joints, 81 states and 432 actions; every call returns the same object.

    An action leads to a state one level away along one joint.
    """
    return arm_space(RANK3, joints=RIGHT)


def reach_plant(seed: int, law: str = "published") -> OfflinePlant:
    """Return an offline plant of the robot of 2014 in an empty world, in which only the four motors of the right arm move.

    `seed`: seed of the plant's random numbers.  `law`: name of the control law, "published" or "default".
    """
    chosen = laws()[law]
    return OfflinePlant(Model(published_robot()), seed, chosen.gains, dt=chosen.dt, active=RIGHT)


def learned_beliefs(plant: OfflinePlant, seed: int, transitions: int = TRANSITIONS) -> OutcomeModel:
    """Return the transition model that a curious agent learns on the plant without a target.

    Learning to reach does not change this model (thesis 8.1).  `seed`: seed of the agent and of the random state to which the arm moves
    first.  `transitions`: number of transitions that the agent makes.
    """
    space = reach_space()
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed)
    explore(agent, transitions)
    return agent.model.debiased()


@cache
def body(law: str = "default") -> Robot:
    """Return the robot for a control law: today's robot file "icub" for "default", that of 2014, "icub_2014", for "published".

    Every call returns the same object.
    """
    return published_robot() if law == "published" else mobee.load_robot("icub")


@cache
def space(law: str = "default") -> Lattice:
    """Return the 81 states of the right arm's four joints with actions from each state to the 16 nearest ones.

    `law`: name of the control law, which selects the robot: "default": today's robot; "published": the robot of 2014.  Every call with the
    same law returns the same object.
    """
    return Lattice(body(law), RIGHT, RANK3, ARM_NEIGHBOURS)


@cache
def hands(law: str = "default") -> Array:
    """Return the position of the right palm in each state of the right arm's lattice, (S, 3) m, root frame, with the wrist at home.

    The S = 81 states are those of the lattice that the function `space` returns for the same law.  `law`: name of the control law, which
    here only selects the robot: "default": today's robot; "published": the robot of 2014.  Every call with the same law returns the same
    object.
    """
    found: Array = Model(body(law)).evaluate(_poses(law)).position(MARKER)
    return found


@cache
def jacobians(law: str = "default") -> Array:
    """Return the Jacobians of the right palm's position in all states of the right arm's lattice, (S, 3, 4) m/rad, root frame.

    The S = 81 states are those of the lattice that the function `space` returns for the same law.  The four columns are the derivatives by
    the angles of shoulder pitch, shoulder roll, shoulder yaw and elbow (RIGHT); all other motors are at home.  `law`: name of the control
    law, which here only selects the robot: "default": today's robot; "published": the robot of 2014.  Every call with the same law returns
    the same object.
    """
    return Model(body(law)).jacobian(_poses(law), MARKER)[:, :3, _motors(law)]


def _poses(law: str) -> Array:
    """Return the pose of the robot in each state of the lattice `space(law)`, (S, n) rad; motors outside the lattice are at home.

    `law`: name of the control law, which here only selects the robot: "default": today's robot; "published": the robot of 2014.
    """
    poses = np.tile(body(law).home, (len(space(law)), 1))
    poses[:, _motors(law)] = space(law).samples
    return poses


def _motors(law: str) -> list[int]:
    return [body(law).motor_index(name) for name in RIGHT]


def arm_plant(seed: int, world: World | None = None, motors: MotorParameters | None = None, law: str = "default") -> OfflinePlant:
    """Return an offline plant (the robot simulated in this process) in which only the four motors of the right arm move.

    `seed`: seed of the plant's random numbers.  `world`: objects around the robot; None: an empty world.  `motors`: parameters of the
    simulated motors, such as their delay; None: the default ones.  `law`: name of the control law, which also selects the robot: "default":
    today's robot; "published": the robot of 2014.
    """
    chosen = laws()[law]
    return OfflinePlant(Model(body(law), world), seed, chosen.gains, motors, chosen.dt, active=RIGHT)


def arm_belief(world: World | None = None, cables: bool = True, turns: Array | None = None, law: str = "default") -> PeerBelief:
    """Return the model of robot and world with which a planner plans motions of the right arm.

    `world`: as the planner believes it to be; None: empty.  `cables`: whether it knows the cable constraints.  `turns`: (4,) rad, error of
    the encoders as the planner believes it: believed minus measured joint angles; None: 0.  `law`: name of the control law, which also
    selects the robot: "default": today's robot; "published": the robot of 2014.
    """
    clauses = [clause for clause in body(law).clauses if clause.part == PART] if cables else []
    return PeerBelief(Model(body(law), world), RIGHT, MARKER, clauses, laws()[law].gains, turns)


def learned_transitions(plant: OfflinePlant, seed: int, transitions: int = TRANSITIONS, law: str = "default") -> TransitionModel:
    """Return the transition model that a curious agent learns on the plant without a target.

    `seed`: seed of the agent.  `transitions`: number of transitions that the agent makes.  `law`: name of the control law of the plant,
    which also selects the robot: "default": today's robot; "published": the robot of 2014.
    """
    agent = CuriousAgent(space(law), plant, seed=seed)
    agent.run(transitions)
    return agent.model


def reach_agent(plant: ReachPlant, model: TransitionModel, seed: int, law: str = "default") -> ReachAgent:
    """Return the reach learner: it predicts rewards by a Gaussian process, and remembers failed transitions for each target position.

    `model`: transition model that the agent continues to learn (thesis 9.4.1).  `seed`: seed of the agent.  `law`: name of the control law
    of the plant, which also selects the robot: "default": today's robot; "published": the robot of 2014.
    """
    where = {"hands": hands(law), "jacobians": jacobians(law)}
    return LEARNERS["gp-ucb"].agent(space(law), plant, marker=MARKER, model=model, seed=seed, **where)


def straight_paths(pairs: Sequence[tuple[int, int]], points: int = 21) -> Array:
    """Return poses on straight paths between states of the right arm, (pairs, points, 4) rad; `points`: number of poses on each path.

    `pairs`: indices of the first and the last state of each path.  A path leads from the first state's sample, the pose that stands for the
    state, to the last state's sample.
    """
    samples, shares = space().samples, np.linspace(0.0, 1.0, points)[:, None]
    found: Array = np.array([samples[a] + shares * (samples[b] - samples[a]) for a, b in pairs])
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Calibration errors.

    `turns`: (n,) rad, true minus measured motor angles.  `shift`: (3,) m, root frame, true minus seen position of the target.
    """

    turns: Array
    shift: Array


class JudgedPlant(WrappedPlant[OfflinePlant]):
    """An offline plant (the robot simulated in this process) with calibration errors of encoders and eyes.

    Actions and reaches use the readings with these errors.  But the outcome of a reach has the true position of the marker (the named point
    on the hand that is brought to the target) and its true distance from the target.

    Args:
        plant: the plant that moves.
        errors: calibration errors of its encoders and eyes; None: no errors.
        unseen: names of world objects that are left out of the contacts in outcomes.
    """

    def __init__(self, plant: OfflinePlant, errors: Errors | None = None, unseen: Collection[str] = ()) -> None:
        super().__init__(plant)
        self.model = plant.model
        self.errors = Errors(np.zeros(len(plant.robot.motors)), np.zeros(3)) if errors is None else errors
        self._unseen = frozenset(unseen)
        self._target: ReachTarget | None = None
        self.reached: Array = np.full(3, np.nan)
        """The true position of the marker at the end of the last reach, (3,) m, root frame; NaN before the first reach."""

    @property
    def time(self) -> float:
        """The time of the plant, s."""
        return self.inner.time

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the plant that moves, the calibration errors and the unseen objects, as JSON values.

        See `mobee.plant.Described.settings`.
        """
        errors = {"turns": self.errors.turns.tolist(), "shift": self.errors.shift.tolist()}
        return self.inner.settings | {"errors": errors, "unseen": sorted(self._unseen)}

    def act(self, part: str, target: Array) -> Outcome:
        """Perform the action, as in `mobee.plant.Plant.act`; the contacts in the outcome do not include those with unseen objects.

        `part`, `target`: as in that method.
        """
        return self._reported(super().act(part, target))

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """Perform an action, as `act` does, but the target exerts no force on the hand that has the marker.

        The method is for planners: their plans decide where the hand keeps away from the target, and where it touches the target.
        """
        return self._reported(self.inner.act(part, target, reaching=marker))

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world at its seen position, or move it there; None removes it, as in `mobee.reach.ReachPlant.present`."""
        self._target = target
        super().present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Pull the marker (a named point on the hand) to the presented target, as in `mobee.reach.ReachPlant.reach`.

        The outcome has the true position of the marker and its true distance from the target.  `stay`: the part stays where the reach
        ended.
        """
        found = super().reach(part, marker, stay)
        self.reached = where = self.marker_at(marker, part, found.q)
        return replace(
            found, marker=where, missing=self._true.missing(where), touched=self._seen(found.touched), after=self._reported(found.after)
        )

    def missing(self, marker: str) -> float:
        """Return the true distance of the marker from the target now, m.

        It is measured from the target's centre, or from its surface if the target's `aim` is "surface" (0 inside the target).  Raises
        InvalidValue if no target is presented.
        """
        return self._true.missing(self.marker_at(marker))

    def marker_at(self, marker: str, part: str | None = None, q: Array | None = None) -> Array:
        """Return the true position of the marker, (3,) m, root frame.

        `part`, `q`: a part and its encoder values (n_part,) rad, from which the position is computed; None: the present encoder values.
        """
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


class Judge(ReachPlant, Protocol):
    """A plant that knows the true position of the hand, and so can judge reaches of plants with wrong encoders.

    `reached`: the true position of the marker at the end of the last reach, (3,) m, root frame.
    """

    reached: Array

    def marker_at(self, marker: str) -> Array:
        """Return the true position of the marker now, (3,) m, root frame."""
        ...


class SeenHand:
    """The hand as a learner sees it, and the errors of the encoders that are estimated from the seen positions.

    `offsets`: estimates the errors of the encoders of some motors.  All plants that `correct` returns share it, so the estimates are kept
    when a learner gets a new plant.  `is_seen`: whether the hand is seen at present.
    """

    def __init__(self, robot: Robot, motors: Sequence[str], seed: int) -> None:
        """`motors`: names of the motors whose offsets are unknown.  `seed`: of the errors of the seen positions."""
        self.offsets, self.is_seen = JointOffsets(Model(robot), MARKER, motors), True
        self._rng = np.random.default_rng(seed)

    def see(self, judge: Judge) -> Array | None:
        """Return the position at which the hand is seen, (3,) m, with a random error of 5 mm along each axis; None if it is not seen."""
        error = self._rng.normal(0.0, NOISE, 3)
        return judge.marker_at(MARKER) + error if self.is_seen else None

    def correct(self, judge: Judge) -> JudgedSeeingPlant:
        """Return a plant whose actions move the plant `judge`, and whose encoder values are corrected.

        The corrections are estimated from the positions at which the hand is seen.  `judge`: the plant with wrong encoders.
        """
        return JudgedSeeingPlant(SelfCalibratingPlant(judge, self.offsets, lambda: self.see(judge)), judge)


class JudgedSeeingPlant(WrappedPlant[SelfCalibratingPlant]):
    """A self-calibrating plant whose outcomes of reaches have the true position of the hand and the true remaining error.

    `inner`: the self-calibrating plant.  `judge`: the plant that `inner` moves; it knows the true position of the hand.
    """

    def __init__(self, inner: SelfCalibratingPlant, judge: Judge) -> None:
        super().__init__(inner)
        self._judge, self._target = judge, ReachTarget(np.zeros(3))

    def present(self, target: ReachTarget | None) -> None:
        """Present a target to the self-calibrating plant, or remove it (None); as in `mobee.reach.ReachPlant.present`.

        The last target is kept, also after None: the true error of a reach is computed from it.
        """
        self._target = target or self._target
        super().present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Reach as `mobee.reach.ReachPlant.reach` does; the outcome has the true position of the marker and the true error that remains.

        `part`, `marker`, `stay`: as in that method.
        """
        found, where = super().reach(part, marker, stay), self._judge.reached
        return replace(found, marker=where, missing=self._target.missing(where))
