"""Crossings of `replanning` on the live robot, to the other side of a ball that turns solid during the motion."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from bus_schema import keys
from bus_schema.messages import Clock, Commands, Forces
from bus_schema.rpc import Done, Place, Request, SetRole
from experiments.claims.ch3_roadmaps.replanning_scene import BALL, LEFT, PART, RATE, RIGHT, Acted, Crossing, Job, ball, new_map, robot
from experiments.kit.live.launch import append_done, read_job
from mobee import ActionInterrupted, MobeeError, Walker
from mobee.arrays import Array
from mobee.plant import Outcome
from mobee.robot.robot import Robot
from services.common.bus_plant import BusPlant
from services.common.lockstep import Participant
from services.common.rpc import CallFailed
from services.common.service import Service

APART = 500_000_000  # ns without a force of an object before its next touch: at a field's border noise decides
AWAY = [0.6, 0.9, 0.6]  # m, where the simulator's ball is out of reach


def perform(service: Service, folder: Path) -> None:
    """Make the crossings of the job in the folder."""
    job = read_job(folder, Job)
    new_map().plan(RIGHT, LEFT)  # what is imported for the first plan is imported before the robot moves
    with ExitStack() as stack:
        watcher = None
        if service.config.mode == "lock":
            watcher = stack.enter_context(Service("watcher", service.config, robot(), inbox=service.inbox))
            watcher.ready()
        hand = FeelingPlant(service, robot(), PART, {BALL}, watcher)
        crosser = Crosser(service, hand)
        service.ready()
        hand.measure(PART)
        for after in job.after:
            append_done(folder, cross_undisturbed(crosser, after))
        hand.leave()


def cross_undisturbed(crosser: Crosser, after: float) -> Crossing:
    """A crossing without interruption: where the machine is too busy for real time the robot holds, and the crossing is repeated."""
    while True:
        try:
            return crosser.cross(after)
        except ActionInterrupted:
            continue


class Crosser:
    """The arm as a plant that records its motions, and turns the ball solid during a crossing."""

    def __init__(self, service: Service, hand: FeelingPlant) -> None:
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
        """See Plant."""
        return self._hand.q

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self._hand.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        space, hand, asked_for = self._map.space, self._hand, time.process_time()
        vertex = int(np.abs(space.samples - target[space.columns]).max(axis=1).argmin())
        outcome = hand.act(part, target)
        bump = -1 if hand.bump is None else hand.bump
        self.motions.append(Acted(vertex, hand.asked, hand.commanded, bump, hand.felt, asked_for - self._ended))
        self._ended = time.process_time()
        return outcome

    def cross(self, after: float) -> Crossing:
        """From the right to the left on a map as it was made; the ball turns solid so many seconds after the start."""
        self.turn(solid=False)
        walker = Walker(new_map(), self, back=False)
        walker.go(RIGHT)
        self.motions.clear()
        self._solid, self._after = -1, after
        walker.go(LEFT)
        return Crossing(self._solid, list(self.motions))

    def turn(self, solid: bool) -> None:
        """Make the ball solid, in the model and in the simulator, or a ghost; in free mode it does not wait for the answers."""
        role, place = "obstacle" if solid else "ghost", self._place if solid else AWAY
        if self._service.locked:
            self._service.call(keys.world_rpc("role"), SetRole, Done, name=BALL, role=role)
            self._service.call(keys.sim("place"), Place, Done, name=BALL, position=place, tries=3)
        else:
            self._service.ask(keys.world_rpc("role"), Done, self._heard, request=SetRole, name=BALL, role=role)
            self._service.ask(keys.sim("place"), Done, self._heard, request=Place, name=BALL, position=place)

    def _heard(self, answer: Done | CallFailed) -> None:
        if isinstance(answer, CallFailed):
            raise MobeeError(f"the ball cannot be changed: {answer}")

    def _tick(self, k: int) -> None:
        """The first motion of a crossing begins when its request has been answered, so the next tick is its first."""
        if self._after >= 0.0 and not self.motions:
            self._solid_at, self._after = k + round(self._after * RATE), -1.0
        if 0 <= self._solid_at <= k:
            self._solid, self._solid_at = k, -1
            self.turn(solid=True)


class FeelingPlant(BusPlant):
    """A BusPlant whose actions end, not settled, as soon as the model says that the part begins to touch one of some objects.

    In lockstep a second service of the same process, the watcher, takes part in every tick, since a part in motion receives none;
    it answers a tick when the forces of that tick have been processed, so what is decided on them falls into that tick.

    Args:
        service, robot, part: see BusPlant.
        objects: names of the objects; fields count, so nothing is hit yet.
        watcher: in lockstep, with the inbox of the service; None in free mode.
    """

    def __init__(self, service: Service, robot: Robot, part: str, objects: Collection[str], watcher: Service | None = None) -> None:
        super().__init__(service, robot, (part,))
        self._part, self._objects = part, frozenset(objects)
        self._last = -APART  # ns, when an object was last felt
        self.bump: int | None = None
        """Tick at which the part began to touch an object since its last action was asked for."""
        self.asked = 0
        """Tick at which the last action was asked for."""
        self.commanded = -1
        """Tick in which a command formed after the last request is first in force, -1: not yet."""
        self.on_forces: Callable[[int], None] = lambda k: None
        """Called with every tick of which the forces have come."""
        self.felt = -1
        """The newest tick of which the forces have come."""
        self._watched = -1
        self._watcher = None if watcher is None else Participant(watcher)
        if watcher is not None:
            watcher.on_clock(self._note_watch)
        service.on_each(Forces, self._feel, "model")
        service.on_each(Commands, self._note_commands)

    def act(self, part: str, target: Array) -> Outcome:
        """See FeelingPlant."""
        self.bump = None
        return super().act(part, target)

    def leave(self) -> None:
        """See BusPlant."""
        super().leave()
        if self._watcher is not None:
            self._watcher.done(max(self._watched, 0), last=True)
            self._watcher = None

    def _ask(self, part: str, verb: str, request: type[Request], **fields: object) -> int:
        self.asked, self.commanded = super()._ask(part, verb, request, **fields), -1
        return self.asked

    def _is_over(self, part: str, action_id: str, asked: int) -> bool:
        if super()._is_over(part, action_id, asked):
            return True
        motion = self._motion.get(part)
        return self.bump is not None and motion is not None and motion.action_id == action_id

    def _feel(self, forces: Forces) -> None:
        if not self._objects.isdisjoint(forces.touched.get(self._part, ())):
            if forces.t - self._last > APART and self.bump is None:
                self.bump = forces.re_k
            self._last = forces.t
        self.felt = forces.re_k
        self.on_forces(forces.re_k)

    def _note_commands(self, commands: Commands) -> None:
        """Commands formed from later ticks than that of the request obey it; each acts a tick later."""
        if self.commanded < 0 and commands.re_k > self.asked > 0:
            self.commanded = commands.re_k + 1

    def _note_watch(self, clock: Clock) -> None:
        self._watched = clock.k

    def _answer(self) -> None:
        super()._answer()
        if self._watcher is not None and self._watched >= 0 and (self._watched == 0 or self.felt >= self._watched):
            self._watcher.done(self._watched)
            self._watched = -1
