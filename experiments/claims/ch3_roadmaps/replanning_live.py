# SPDX-License-Identifier: Apache-2.0
"""The crossings of the experiment `replanning` on the live robot: the scene, a roadmap of three poses around a ball, and the motions."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import numpy as np
from msgspec import Struct

from bus_schema import keys
from bus_schema.messages import Clock, Commands, Forces
from bus_schema.rpc import Done, Place, Request, SetRole
from experiments.kit.live.launch import append_done, read_job
from mobee import ActionInterrupted, AdaptiveRoadmap, MobeeError, Model, Space, Walker, load_robot, load_world
from mobee.arrays import Array
from mobee.plant import Outcome
from mobee.robot.robot import Robot
from services.common.bus_plant import BusPlant, Sent
from services.common.lockstep import Participant
from services.common.rpc import CallFailed
from services.common.service import Service

ROBOT, PART, MARKER = "icub", "right_arm", "right_palm"
BALL, RADIUS = "ball", 0.03
RIGHT, LEFT, ABOVE = 0, 1, 2  # vertices
POSES = (  # rad, shoulder and elbow; the wrist is straight
    (-0.41, 1.36, 0.84, 0.68),  # at the right of the ball
    (-1.22, 0.58, 0.94, 1.30),  # at its left
    (-1.14, 1.38, 0.30, 0.67),  # above it
)
GOALS = ((LEFT, ABOVE), (RIGHT, ABOVE), (RIGHT, LEFT))
WORLD = Path(__file__).with_name("replanning_ghost.xml")  # the objects of the model
SIMULATED = Path(__file__).with_name("replanning_away.xml")  # the objects of the simulator at first
RATE, SPEED = 100.0, 1.0  # Hz; share of the motors' speed


@cache
def robot() -> Robot:
    """Return the robot of this experiment, the iCub."""
    return load_robot(ROBOT)


def new_map() -> AdaptiveRoadmap:
    """Return a new roadmap with three poses of the right arm (RIGHT, LEFT and ABOVE the ball) without observations."""
    arm = robot().parts[PART]
    samples = np.zeros((len(POSES), 7))
    samples[:, :4] = POSES
    low, high = robot().limits[arm.slice].T
    rest = np.clip((robot().home[arm.slice] - low) / (high - low), 0.0, 1.0)
    return AdaptiveRoadmap(Space(robot(), arm.motors[:7], samples, GOALS, rest.tolist()), both_ways=True)


def model() -> Model:
    """Return a model of the robot and its world, in which the ball is a ghost, an object that exerts no force."""
    return Model(robot(), load_world(str(WORLD)))


def ball() -> Array:
    """Return the position of the ball in the model's world, (3,) m, root frame."""
    return model().world.objects[BALL].position


class Job(Struct, frozen=True):
    """The crossings (motions of the arm from the right of a ball to its left) of one launch (start of the live system).

    `after`: for each crossing, the time [s] from its start until the ball, through which the arm could pass before, becomes solid.
    """

    after: list[float]


class Acted(Struct, frozen=True):
    """A motion of the arm along an edge of the roadmap.

    Ticks are those of the simulator, robot_sim.  `vertex`: the goal.  `asked`: tick of the request.  `commanded`: first tick in which the
    motors execute a command that was computed after the request.  `bump`: tick at which the model first reported that the arm touches the
    ball; -1: never.  `ended`: tick at which the end of the motion was received.  `thinking`: processor time [s] from the end of the
    previous motion to this request.
    """

    vertex: int
    asked: int
    commanded: int
    bump: int
    ended: int
    thinking: float


class Crossing(Struct, frozen=True):
    """One crossing of the arm from the right of the ball to its left.

    `solid`: tick at which the ball was made solid.  `motions`: its motions, in order.
    """

    solid: int
    motions: list[Acted]


MIN_GAP = 500_000_000  # ns without a force of an object before a new touch: noise toggles contacts at a field's border
AWAY = [0.6, 0.9, 0.6]  # m, a place of the simulator's ball out of reach


def perform(service: Service, folder: Path) -> None:
    """Make the crossings of the job in `folder` with the live robot, and append each to the file of finished crossings there."""
    job = read_job(folder, Job)
    new_map().plan(RIGHT, LEFT)  # imports what planning needs before the robot moves
    with ExitStack() as stack:
        watcher = None
        if service.config.mode == "lock":
            watcher = stack.enter_context(Service("watcher", service.config, robot(), inbox=service.inbox))
            watcher.ready()
        hand = ContactStopPlant(service, robot(), PART, {BALL}, watcher)
        crosser = Crosser(service, hand)
        service.ready()
        hand.measure(PART)
        for after in job.after:
            append_done(folder, cross_undisturbed(crosser, after))
        hand.leave()


def cross_undisturbed(crosser: Crosser, after: float) -> Crossing:
    """Make a crossing whose ball becomes solid after `after` s; repeat the crossing if a hold (a safe stop) interrupts it."""
    while True:
        try:
            return crosser.cross(after)
        except ActionInterrupted:
            continue


class Crosser:
    """A plant that moves the right arm, records its motions and makes the ball solid during a crossing.

    In a crossing a `Walker`, which follows the edges of a roadmap, acts through this plant.  `motions`: the motions of the present
    crossing.  `hand`: the plant that moves the arm on the live robot.
    """

    def __init__(self, service: Service, hand: ContactStopPlant) -> None:
        self.robot, self.motions = hand.robot, list[Acted]()
        self._service, self._hand = service, hand
        self._map = new_map()
        self._place = ball().tolist()  # computed once: it takes half a second, too long during a motion
        self._solid_at = self._solid = -1  # ticks
        self._after = -1.0  # s
        self._ended = 0.0  # s of processor time
        hand.on_forces = self._tick

    @property
    def q(self) -> Array:
        """The present encoder values of all motors, (n,) rad."""
        return self._hand.q

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the motors of `part`, (n_part,) rad; see `mobee.plant.Plant.measure`."""
        return self._hand.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """Move the part to `target` (n_part,) rad, record the motion in `motions`, and return its outcome; see `mobee.plant.Plant.act`."""
        space, hand, asked_for = self._map.space, self._hand, time.process_time()
        vertex = int(np.abs(space.samples - target[space.columns]).max(axis=1).argmin())
        outcome = hand.act(part, target)
        bump = -1 if hand.bump is None else hand.bump
        self.motions.append(Acted(vertex, hand.asked, hand.commanded, bump, hand.evaluated, asked_for - self._ended))
        self._ended = time.process_time()
        return outcome

    def cross(self, after: float) -> Crossing:
        """Move from the right of the ball to its left on a new roadmap.  `after`: time [s] from the start until the ball becomes solid."""
        self.turn(solid=False)
        walker = Walker(new_map(), self, back=False)
        walker.go(RIGHT)
        self.motions.clear()
        self._solid, self._after = -1, after
        walker.go(LEFT)
        return Crossing(self._solid, list(self.motions))

    def turn(self, solid: bool) -> None:
        """Make the ball solid or a ghost in the model, and place it in the simulator or remove it out of reach.

        In lockstep this waits for the answers of the model and the simulator; raises CallFailed if one of them refuses.  In free mode
        (ticks follow the clock) this does not wait; MobeeError is raised later, when a refusal arrives.
        """
        role, place = "obstacle" if solid else "ghost", self._place if solid else AWAY
        if self._service.locked:
            self._service.call(keys.world_rpc("role"), SetRole, Done, name=BALL, role=role)
            self._service.call(keys.sim("place"), Place, Done, name=BALL, position=place, tries=3)
        else:
            self._service.ask(keys.world_rpc("role"), Done, self._check_answer, request=SetRole, name=BALL, role=role)
            self._service.ask(keys.sim("place"), Done, self._check_answer, request=Place, name=BALL, position=place)

    def _check_answer(self, answer: Done | CallFailed) -> None:
        if isinstance(answer, CallFailed):
            raise MobeeError(f"the ball cannot be changed: {answer}")

    def _tick(self, k: int) -> None:
        """Make the ball solid when tick `k` is `after` s (see `cross`) later than the first tick of the crossing.

        The first tick is the first one whose forces are received during the crossing.  Called with each tick whose forces are received.
        """
        if self._after >= 0.0 and not self.motions:
            self._solid_at, self._after = k + round(self._after * RATE), -1.0
        if 0 <= self._solid_at <= k:
            self._solid, self._solid_at = k, -1
            self.turn(solid=True)


class ContactStopPlant(BusPlant):
    """A BusPlant (the live robot as a plant) whose actions end when the model reports that the part begins to touch one of some objects.

    Such an action ends early, and `settled` of its outcome is False.  In lockstep (every tick waits for all participants) the plant
    receives no ticks while its part moves.  Therefore a second service of the same process, the watcher, takes part in every tick.  It
    answers a tick only after the plant has received the contact forces of that tick, so that the plant reacts to them in the same tick.

    Args:
        service, robot, part: see BusPlant.
        objects: names of the objects.  Overlap with a field, the larger volume around a link that is not solid, also counts as touch.
        watcher: second service of this process; both services put their messages into one inbox.  None in free mode (ticks do not wait).
    """

    def __init__(self, service: Service, robot: Robot, part: str, objects: Collection[str], watcher: Service | None = None) -> None:
        super().__init__(service, robot, (part,))
        self._part, self._objects = part, frozenset(objects)
        self._last = -MIN_GAP  # ns, time of the last force of an object
        self.bump: int | None = None
        """Tick of robot_sim in which the part began to touch an object after the request of the last action; None: not yet."""
        self.asked = 0
        """Tick of robot_sim in which the last action was requested."""
        self.commanded = -1
        """Tick in which a command computed after the last request is first in force; -1: not yet."""
        self.on_forces: Callable[[int], None] = lambda k: None
        """Function that is called with the number of every tick whose forces have been received."""
        self.evaluated = -1
        """The number of the newest tick whose forces have been received; -1: none yet."""
        self._watched = -1
        self._watcher = None if watcher is None else Participant(watcher)
        if watcher is not None:
            watcher.on_clock(self._note_watch)
        service.on_each(Forces, self._record_bump, "model")
        service.on_each(Commands, self._note_commands)

    def act(self, part: str, target: Array) -> Outcome:
        """Move the part to `target` (n_part,) rad; the action also ends when the part begins to touch one of the objects."""
        self.bump = None
        return super().act(part, target)

    def leave(self) -> None:
        """Release the part's goal (the right to move the part), as in `BusPlant.leave`.

        In lockstep (every tick waits for all participants), also report that later ticks need not wait for this service and for the
        watcher.
        """
        super().leave()
        if self._watcher is not None:
            self._watcher.done(max(self._watched, 0), last=True)
            self._watcher = None

    def _send(self, part: str, verb: str, request: type[Request], action_id: str, **fields: object) -> Sent:
        sent = super()._send(part, verb, request, action_id, **fields)
        self.asked, self.commanded = sent.k, -1
        return sent

    def _is_over(self, part: str, sent: Sent) -> bool:
        if super()._is_over(part, sent):
            return True
        motion = self._motion.get(part)
        return self.bump is not None and motion is not None and motion.action_id == sent.id

    def _record_bump(self, forces: Forces) -> None:
        if not self._objects.isdisjoint(forces.touched.get(self._part, ())):
            if forces.t - self._last > MIN_GAP and self.bump is None:
                self.bump = forces.re_k
            self._last = forces.t
        self.evaluated = forces.re_k
        self.on_forces(forces.re_k)

    def _note_commands(self, commands: Commands) -> None:
        """Store the first tick in which the motors execute a command that was computed after the request of the motion.

        It is one tick after the tick of the state from which this command was computed.
        """
        if self.commanded < 0 and commands.re_k > self.asked > 0:
            self.commanded = commands.re_k + 1

    def _note_watch(self, clock: Clock) -> None:
        self._watched = clock.k

    def _answer(self) -> None:
        super()._answer()
        if self._watcher is not None and self._watched >= 0 and (self._watched == 0 or self.evaluated >= self._watched):
            self._watcher.done(self._watched)
            self._watched = -1
