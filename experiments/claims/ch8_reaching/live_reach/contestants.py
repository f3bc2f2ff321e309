# SPDX-License-Identifier: Apache-2.0
"""Performs a job, a list of tries, on the live robot: by the learner (which may continue to learn), by the planner, or by single reaches.

In a reach a force pulls the palm to the target.  The plant of the live arm (`Hand`) times the reaches, and a `Mover` moves a target or an
obstacle meanwhile.  `learned_offline` makes the learner's tries on the offline plant (the robot simulated in one process), for comparison.

The performer, a service that calls a function of an experiment (experiments/kit/live/performer), calls `perform`.  This function reads the
streams {part}/motion, {part}/reach and commands, and calls {part}/rpc/{take,goal,reach} of the controller and model/rpc/world/{add,remove}.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from bus_schema import keys
from bus_schema.messages import Clock, Commands, Geometry, Reach
from bus_schema.rpc import AddObject, Done, MoveObject, OneName, Place, Request
from experiments.claims.ch8_reaching.live_reach.problems import (
    AIM,
    MIN_STATE_DISTANCE,
    RATE,
    REACHES,
    SPEED,
    SUCCESS_DISTANCE,
    TARGET_MOVES,
    WRIST,
    Problem,
    belief,
    grid_targets,
    learner,
    offline_plant,
)
from experiments.claims.ch8_reaching.live_reach.tries import Block, Job, Judged, Tried
from experiments.kit.live.launch import append_done, read_job
from experiments.kit.plants import WrappedPlant
from experiments.kit.reaching.arm import MARKER, PART
from experiments.kit.reaching.learning import Course
from experiments.kit.reaching.planner_peer import PlannerPeer
from mobee import ActionInterrupted, Model, load_robot
from mobee.arrays import Array
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.record import load_reaches
from mobee.plant import Outcome
from mobee.reach import RADIUS, ReachTarget
from mobee.robot.robot import Robot
from services.common.bus_plant import BusPlant, Sent
from services.common.lockstep import Participant
from services.common.service import Service

MIN_CHANGE = 5e-3  # rad/s, difference of a command that moves from the last one before the request
MOVING_TARGET, OBSTACLE = "moving_target", "obstacle"  # names in the world; the obstacle is that of obstacle.xml
MOVE_PERIOD = 5  # ticks between two positions of a moving object
AWAY = np.array([0.6, 0.9, 0.6])  # m, position of an obstacle that is not used
UPRIGHT, SPHERE = [1.0, 0.0, 0.0, 0.0], Geometry(kind="sphere", size=[RADIUS])


def perform(service: Service, folder: Path) -> None:
    """Make the tries of the job in `folder`, and append the record of each try to a file in that folder.

    In a job of the kind "refine" the learner first continues to learn.  The launched performer calls this function with its own service.
    """
    job, robot = read_job(folder, Job), load_robot(service.config.robot)
    with ExitStack() as stack:
        mover = None
        if job.kind == "moving":
            other = stack.enter_context(Service("mover", service.config, robot, inbox=service.inbox))
            mover = Mover(other, 1.0 / RATE)
            other.ready()
        hand = Hand(service, robot)
        attempt = contestant(hand, job, mover)
        agent = learner(hand, job.seed, Path(job.store)) if job.kind == "refine" else None
        service.ready()
        hand.measure(PART)
        if agent is not None:
            agent.learn(grid_targets(), max(0, job.tries - agent.tries))
        for problem in job.problems:
            append_done(folder, _tried(hand, problem, attempt))
        hand.leave()
        if mover is not None:
            mover.leave()


def _tried(hand: Hand, problem: Problem, attempt: Callable[[Problem], Ended]) -> Tried:
    """Make one try from the first posture, to which the arm moves from home; returns its record."""
    start, off, why = np.array(problem.start), np.inf, ""
    out = begin = hand.tick
    try:
        hand.present(None)
        hand.act(PART, hand.robot.home[hand.robot.part(PART).slice])
        off = float(np.abs(hand.act(PART, start).q - start)[:WRIST].max())
        begin = hand.tick
        made = attempt(problem)
    except ActionInterrupted as error:
        hand.measure(PART)
        made, why = Ended([], 0, np.inf), str(error)
    return Tried(
        kind=problem.kind,
        number=problem.number,
        out=out,
        begin=begin,
        ends=made.ends,
        over=hand.tick,
        off=off,
        actions=made.actions,
        believed=made.believed,
        thinking=made.thinking,
        asked=hand.asked,
        first=made.first,
        why=why,
        there=made.there,
    )


@dataclass(frozen=True, slots=True)
class Ended:
    """The result of one attempt to reach a target.

    `ends`: ticks at which the reaches ended, or at which the planner had finished.  `actions`: number of actions, reaches included.
    `believed`: distance of the palm from the target's surface at the end, by the encoders, m.  `thinking`: processor time for plans, s.
    `first`: ticks from the request of the last reach to the first command that moves the arm; -1: not timed.
    """

    ends: list[int]
    actions: int
    believed: float
    thinking: float = 0.0
    first: int = -1
    there: list[float] | None = None
    """Position of a moving target at the last of the ends, (3,) m, root frame; None for a target at rest."""


def contestant(hand: Hand, job: Job, mover: Mover | None) -> Callable[[Problem], Ended]:
    """Return a function that lets the contestant of a job (the learner, the planner, or the reach alone) attempt a problem.

    A learner is loaded now, and its slow first predictions for the job's targets are made now, so that they do not delay the attempts.  In
    a job of the kind "first motion", `hand` times from now on when each reach begins to move.  `mover`: moves the target or the obstacle
    during an attempt; None: nothing moves.
    """
    if job.kind == "peer":
        return partial(planned, hand, job.seed)
    if job.kind in ("learner", "moving"):
        agent = load_reaches(job.store, hand, PART)
        for problem in job.problems:
            agent.predictor.mean(problem.target.position)  # before the try, because the first prediction for a target is slow
        return partial(learned, hand, agent, job.seed, mover)
    if job.kind == "first motion":
        hand.watch_commands()
    return partial(at_once, hand)


def learned(hand: Hand, agent: ReachAgent, seed: int, mover: Mover | None, problem: Problem) -> Ended:
    """Let the learner attempt a problem: go to the state with the highest expected reward, and reach; returns the result.

    After a miss it reaches from another state, up to three times in all.  The learner learns nothing.  `seed`: of the draws among equally
    good actions.  `mover`: moves the target or the obstacle; None: nothing moves.
    """
    where = _present(hand, mover, problem)
    course = Course(hand, agent, agent.predictor.mean, where, np.random.default_rng([seed, problem.number]), MIN_STATE_DISTANCE)
    ends: list[int] = []
    missing = np.inf
    while len(ends) < REACHES and missing > SUCCESS_DISTANCE:
        course.go()
        missing = hand.reach(PART, MARKER).missing
        ends.append(hand.end)
        course.missed()
    there = None
    if mover is not None:
        there = mover.at(ends[-1]).tolist() if problem.kind == TARGET_MOVES else None
        mover.stop()
    return Ended(ends, course.actions + len(ends), missing, course.thinking, there=there)


def learned_offline(job: Job) -> Block:
    """Let the learner attempt the problems of a job on the offline plant, and return all tries with their measures.

    The learner is loaded from the file `job.store`, with all that it learned offline and live.  It attempts the problems as in `learned`,
    and learns nothing.  Contacts are not recorded, so the block has none.
    """
    plant, tries = offline_plant(job.seed), list[Judged]()
    agent = load_reaches(job.store, plant, PART)
    for problem in job.problems:
        start, target = np.array(problem.start), problem.target
        plant.present(None)
        plant.act(PART, plant.robot.home[plant.robot.part(PART).slice])
        off = float(np.abs(plant.act(PART, start).q - start)[:WRIST].max())
        plant.present(target)
        rng = np.random.default_rng([job.seed, problem.number])
        course = Course(plant, agent, agent.predictor.mean, partial(np.array, problem.position), rng, MIN_STATE_DISTANCE)
        begin, reaches, missing = plant.time, 0, np.inf
        while reaches < REACHES and missing > SUCCESS_DISTANCE:
            course.go()
            missing = plant.reach(PART, MARKER).missing
            reaches += 1
            course.missed()
        tries.append(
            Judged(
                kind=problem.kind,
                number=problem.number,
                position=problem.position,
                off=missing,
                success=missing <= SUCCESS_DISTANCE,
                seconds=plant.time - begin,
                actions=course.actions + reaches,
                reaches=reaches,
                thinking=course.thinking,
                deep=[],
                begun_off=off,
                why="",
                first=-1,
                first_motion=-1,
            )
        )
    return Block("offline", RATE, plant.time, True, tries, [])


def _present(hand: Hand, mover: Mover | None, problem: Problem) -> Callable[[], Array]:
    """Present the target, and start the moving object; returns a function that returns the target's present position, (3,) m."""
    target = problem.target
    if mover is not None and problem.path is not None:
        mover.start(MOVING_TARGET if problem.kind == TARGET_MOVES else OBSTACLE, problem.path)
        if problem.kind == TARGET_MOVES:
            hand.present_object(MOVING_TARGET, AIM)
            return mover.now
    hand.present(target)
    return lambda: target.position


def planned(hand: Hand, seed: int, problem: Problem) -> Ended:
    """Let the planner attempt a problem: inverse kinematics and RRT-Connect, replanned after every unexpected outcome.

    `seed`: of the planner.
    """
    plant = PeerPlant(hand, 1.0 / RATE)
    peer = PlannerPeer(plant, belief(), PART, "none", seed + problem.number)
    made = peer.try_problem(problem.target)
    return Ended(plant.ends, made.actions, made.missing, made.planning)


def at_once(hand: Hand, problem: Problem) -> Ended:
    """Attempt a problem by one reach from the present posture, without a plan; returns the result.

    In a reach a force pulls the palm to the target.
    """
    hand.present(problem.target)
    missing = hand.reach(PART, MARKER).missing
    return Ended([hand.end], 1, missing, first=hand.first)


class Hand(BusPlant):
    """The live arm as a plant, which records when its last reach was requested, began to move, and ended.

    `asked`: tick of the last request.  `first`: number of ticks from it to the first command that moves the arm; -1: not timed.  `end`:
    tick at which the force of the reach ended.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        super().__init__(service, robot, (PART,))
        self._link, self._where = service, robot.part(PART).slice
        self.end = 0
        """Tick at which the force of the last reach ended."""
        self.first = -1
        """Ticks from the request of the last reach to the first command that moves; -1: not timed."""
        self.asked = 0
        """Tick of the last request."""
        self._before: Array | None = None
        service.on_each(Reach, self._note_reach, PART)

    @property
    def tick(self) -> int:
        """The current tick: the newer one of the tick of the bus and that of the part's last motion message.

        In lockstep (every tick waits for all participants) only messages of this part arrive.
        """
        motion = self._motion.get(PART)
        return self._link.bus.k if motion is None else max(self._link.bus.k, motion.k)

    def watch_commands(self) -> None:
        """Time every following reach: after it, `first` has the number of ticks from its request to the first command that moves the arm.

        From then on all commands are received, which costs time in every tick.
        """
        self._link.on_each(Commands, self._note_commands)

    def _send(self, part: str, verb: str, request: type[Request], action_id: str, **fields: object) -> Sent:
        self.first = -1
        sent = super()._send(part, verb, request, action_id, **fields)
        self.asked = sent.k
        return sent

    def _note_reach(self, reach: Reach) -> None:
        self.end = reach.end_k

    def _note_commands(self, commands: Commands) -> None:
        """Set `first` at the first command of the arm that responds to the last request and differs from the last one before it.

        A command that was computed from the state of tick k acts from tick k + 1 on.  It can respond only to requests before tick k.
        """
        reference = np.array(commands.ref[self._where])
        if commands.re_k <= self.asked:
            self._before = reference
        elif self.first < 0 and self._before is not None and np.abs(reference - self._before).max() > MIN_CHANGE:
            self.first = commands.re_k + 1 - self.asked


class PeerPlant(WrappedPlant[Hand]):
    """The live arm as the plant of the planner; the target exerts no force during motions, because the planner avoids it."""

    def __init__(self, hand: Hand, tick: float) -> None:
        """Wrap the live arm; `tick`: duration of a tick, s."""
        super().__init__(hand)
        self.ends = list[int]()
        """Ticks at which the peer had finished."""
        self._model, self._dt = Model(hand.robot), tick
        self._target: ReachTarget | None = None

    @property
    def time(self) -> float:
        """The time of the robot's clock, s: the number of the current tick times the duration of a tick."""
        return self.inner.tick * self._dt

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """Remove the target from the world, and perform an action of the part to `target` (n_part,) rad.

        As in `experiments.kit.reaching.arm.JudgedPlant.go`; `marker` is not used.
        """
        self.inner.present(None)
        return self.act(part, target)

    def present(self, target: ReachTarget | None) -> None:
        """Put a target into the world, or remove it (None), and keep it for `missing`; as in `mobee.reach.ReachPlant.present`."""
        self._target = target
        super().present(target)

    def missing(self, marker: str) -> float:
        """Return the distance of the marker from the target now, computed from the encoder values, m; inf without a target.

        The tick of the call is appended to the list `ends` of this plant.
        """
        self.ends.append(self.inner.tick)
        whole = self.robot.home.copy()
        whole[self.robot.part(PART).slice] = self.measure(PART)
        target = self._target
        return np.inf if target is None else target.missing(self._model.evaluate(whole).position(marker))


class Mover:
    """Moves one object back and forth at 3 cm/s; its service takes part in the lockstep (every tick waits for all participants).

    It moves the object in the world of the model and, if it is the obstacle, in the simulator.
    """

    def __init__(self, service: Service, tick: float) -> None:
        """Take part in the lockstep by `service`; `tick`: duration of a tick, s."""
        self._service, self._dt = service, tick
        self._step = Participant(service)
        self._name = ""
        self._ends = np.zeros((2, 3))
        self._begin = self._k = 0
        service.on_clock(self._tick)

    def start(self, name: str, ends: list[list[float]]) -> None:
        """Move an object back and forth between two positions from now on, starting at the first.

        `name`: "moving_target", which is added to the world, or "obstacle".  `ends`: two positions [x, y, z], m, root frame.
        """
        self._ends, self._begin = np.array(ends), self._k
        if name == MOVING_TARGET:
            self._service.call(
                keys.world_rpc("add"), AddObject, Done, name=name, geometry=SPHERE, position=ends[0], quaternion=UPRIGHT, role="target"
            )
        self._name = name
        self._put(self.at(self._k))

    def stop(self) -> None:
        """Stop the motion: remove the target from the world, or put the obstacle far away."""
        name, self._name = self._name, ""
        if name == MOVING_TARGET:
            self._service.call(keys.world_rpc("remove"), OneName, Done, name=name)
        elif name:
            self._place(name, AWAY)

    def at(self, k: int) -> Array:
        """Return the position of the moving object at tick `k`, (3,) m, root frame."""
        path = self._ends[1] - self._ends[0]
        gone = SPEED * self._dt * ((k - self._begin) // MOVE_PERIOD * MOVE_PERIOD) / max(float(np.linalg.norm(path)), 1e-9)
        found: Array = self._ends[0] + (1.0 - abs(1.0 - gone % 2.0)) * path
        return found

    def now(self) -> Array:
        """Return the position of the moving object at the present tick, (3,) m, root frame."""
        return self.at(self._k)

    def leave(self) -> None:
        """End the motion, and leave the lockstep: later ticks do not wait for this service."""
        self._name = ""
        self._step.done(self._k, last=True)

    def _tick(self, clock: Clock) -> None:
        self._k = clock.k
        if self._name and (clock.k - self._begin) % MOVE_PERIOD == 0:
            self._put(self.at(clock.k))
        self._step.done(clock.k)

    def _put(self, position: Array) -> None:
        if self._name == MOVING_TARGET:
            self._move(MOVING_TARGET, position)
        else:
            self._place(self._name, position)

    def _place(self, name: str, position: Array) -> None:
        self._move(name, position)
        self._service.call(keys.sim("place"), Place, Done, name=name, position=position.tolist(), tries=3)

    def _move(self, name: str, position: Array) -> None:
        self._service.call(keys.world_rpc("move"), MoveObject, Done, name=name, position=position.tolist())
