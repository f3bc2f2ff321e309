# SPDX-License-Identifier: Apache-2.0
"""The live plant (the running robot, in the form that agents need): acts and reaches with parts through controller and model on the bus."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import Clock, EStop, Motion, Tick, Turn
from bus_schema.rpc import Done, Goal, ObjectState, ReachFor, Request, Started, Take, Taken, WithEpoch
from mobee.arrays import Array
from mobee.control.forces import checked
from mobee.errors import ActionInterrupted, InvalidValue, MobeeError, UnknownName
from mobee.plant import Outcome
from mobee.reach import Aim, ReachOutcome, ReachTarget
from mobee.robot.robot import Robot
from services.common.hands import require_apart
from services.common.lockstep import Participant
from services.common.reach_client import TRIES, ReachClient
from services.common.rpc import CallFailed
from services.common.service import Service

RETRY_PERIOD = 0.2  # s between attempts while there is no controller or the part is in hold
OWNED_PATIENCE = 3.0  # s for which a goal may belong to another service: the token of one that ended lasts up to a second
SEND_AGAIN_WITHIN = 10.0  # s of the bus clock from the end of the controller, as LONGEST_SUSPENSION of services/controller/action.py


@dataclass(frozen=True)
class Sent:
    """An action that a controller has accepted.

    `id`: id of the action. `controllers`: ids of the controller processes that were running when the action was sent. `k`, `first_k`: tick
    at which the action began. If the controller has ended and the action was sent again to a new one, `k` is the tick of the new start and
    `first_k` that of the first start; `touched`: names of the world objects that the part had touched before the new start.
    """

    id: str
    controllers: frozenset[str]
    k: int
    first_k: int
    touched: frozenset[str] = frozenset()


class BusPlant:
    """The live robot as a plant (`mobee.reach.ReachPlant`): acts and reaches with some parts through controller and model on the bus.

    To move a part, the plant takes the part's goal. The goal is the right to set the attractor, which is the posture to which the
    controller moves the part. While the plant waits, the service answers calls.

    In lockstep (every tick waits for all participants) the plant also answers the ticks for its service. It answers a tick only when the
    service waits again, that is, after the service has decided on its next action. So simulated time stands still during a decision. If the
    decision takes longer than the setting `patience` of robot_sim (s of real time), robot_sim no longer waits for the service.
    """

    def __init__(self, service: Service, robot: Robot, parts: tuple[str, ...]) -> None:
        self._service, self.robot, self._parts = service, robot, parts
        self._epochs: dict[str, int] = {}
        self._refused_since: dict[str, float] = {}  # monotonic clock
        self._motion: dict[str, Motion] = {}
        self._tick = 0.0  # s
        self._q: Array | None = None  # (n,) rad; None before the first use of `q`
        self._reads_all = False
        self._runs = 0
        self._participant = Participant(service)
        self._wanted: set[str] = set()  # parts that were measured
        self._is_resting = False
        self._was_stopped = False  # an emergency stop was received since the action was sent
        self._to_answer: int | None = None  # lockstep: the tick that waits for this service
        for part in parts:
            robot.part(part)
            service.on_newest(Motion, self._noter(part), part)
        if service.locked:
            service.on_turn(self._note_turn)
        else:
            service.on_clock(self._note_clock)
        service.on_run(self._new_run)
        service.on_newest(EStop, self._note_stop, any_run=True)
        self._reaches = ReachClient(service, parts)

    @property
    def q(self) -> Array:
        """The encoder values of all motors at the newest tick, (n,) rad; the first use waits for a tick."""
        if not self._reads_all:
            self._service.on_newest(Tick, self._note_q)
            self._reads_all = True
        while self._q is None:
            self._service.check_router()
            self._wait(lambda: self._q is not None)
        return self._q.copy()

    def measure(self, part: str) -> Array:
        """Return the part's motor positions, (n_part,) rad, by the encoders.

        First takes the goal of the part (the right to set its attractor), if this service does not own it, and waits until the controller
        has the part under control, that is, until robot_sim follows its commands. Raises ActionInterrupted while this service rests
        (between `rest` and `resume`), MobeeError if the goal belongs to another service for more than OWNED_PATIENCE (3 s), UnknownName for
        a part that is not one of this plant.
        """
        if part not in self._parts:
            raise UnknownName("part of this plant", part, self._parts)
        self._require_awake(part)
        self._wanted.add(part)
        while not (self._owns(part) and self._is_free(part)):
            self._require_awake(part)
            self._service.check_router()
            self._take(part)
            self._wait(lambda: self._owns(part) and self._is_free(part))
        return np.array(self._motion[part].q)

    def act(self, part: str, target: Array) -> Outcome:
        """Set the part's attractor to `target` (n_part,) rad, and wait until the part has settled or timed out; return the outcome.

        The attractor is the posture to which the controller moves the part. Implements `mobee.plant.Plant.act`. If the controller ends, the
        action continues as soon as another controller has the part under control. Raises UnknownName for a part that is not one of this
        plant. Raises InvalidValue for a target that is not n_part finite numbers, or is beyond the limits. Raises ActionInterrupted if the
        part is in hold (it stands still and follows no commands) or has a fault; if robot_sim starts a new run; if no controller can
        continue the action within 10 s; or if the controller gives the part's goal to another service.
        """
        q = checked(f"attractor of {part}", target, len(self.robot.part(part)))
        sent = self._perform(part, "goal", Goal, q=q.tolist())
        return self._outcome(part, sent)

    def present(self, target: ReachTarget | None) -> None:
        """Put a target into the model's world as the object `reach_target`, or move it there; None removes it.

        Implements `mobee.reach.ReachPlant.present`. Raises ActionInterrupted if the model does not answer, InvalidValue if it refuses the
        target.
        """
        self._reaches.present(target)

    def present_object(self, name: str, aim: Aim = "centre", normal: Array | None = None, faces: bool = False) -> ReachTarget:
        """Use the object `name` of the model's world as the target of reaches; return the target at its present position.

        If the object moves, reaches follow it. `aim`: the marker has to reach the "centre" or the "surface" of the target. `normal`:
        desired direction (3,) of the marker's normal, root frame; None: any. `faces`: True: the normal has to point at the target. Raises
        UnknownName if there is no such object; InvalidValue if it is stale, that is, not seen any more, or if its role is not target;
        ActionInterrupted if the model does not answer.
        """
        return self._reaches.present_object(name, aim, normal, faces)

    def places(self) -> dict[str, Array]:
        """Return the positions (3,) m, root frame, of the free objects in the model's world, by name.

        These are the objects of the world's file and those that vision perceives. Objects that are attached to a link, and perceived
        objects that are stale, are left out. An agent whose states contain the position of an object uses it as `PerceivingPlant(plant,
        plant.places)`. Raises ActionInterrupted if the model does not answer.
        """
        return {name: np.array(one.position) for name, one in self.objects().items()}

    def objects(self) -> dict[str, ObjectState]:
        """Return the free objects in the model's world, by name, with their roles and the time of the newest picture of each.

        Objects that are attached to a link, and perceived objects that are stale, are left out. Raises ActionInterrupted if the model does
        not answer.
        """
        return self._reaches.objects()

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Pull a marker (a named point on a link) to the target, set by `present` or `present_object`, by a force; return the outcome.

        The force ends when the part has settled or timed out. Then the attractor (the posture to which the controller moves the part) pulls
        the part back, or, with `stay`, the part stays where the force ended. Implements `mobee.reach.ReachPlant.reach`. Raises UnknownName
        for an unknown marker; InvalidValue if no target is presented, the part does not move the marker, or it moves the target, which is
        attached to a link, together with the marker; ActionInterrupted if the model does not answer; if the part is in hold (it stands
        still and follows no commands) or has a fault; if robot_sim starts a new run; if the controller ends; or if the controller gives the
        part's goal to another service.
        """
        self.robot.marker(marker)
        self._require_awake(part)  # before the target is presented again
        asked = self._reaches.asked()
        require_apart(self.robot, part, marker, *self._reaches.attached_to())
        sent = self._perform(part, "reach", ReachFor, marker=marker, stay=stay, **asked)
        after = self._outcome(part, sent)
        return self._reaches.outcome(part, self._motion[part], after, self._tick)

    def _perform(self, part: str, verb: str, request: type[Request], **fields: object) -> Sent:
        """Start an action and wait for its end.  Raises ActionInterrupted, or InvalidValue if it is refused."""
        if part not in self._epochs:
            self.measure(part)
        elif part in self._motion and not self._owns(part):
            del self._epochs[part]
            raise ActionInterrupted(f"{part}: this service lost its goal; measure the part again")
        run, self._was_stopped = self._runs, False
        sent = self._send(part, verb, request, uuid.uuid4().hex, **fields)

        def is_known() -> bool:
            return self._is_over(part, sent) and (
                verb == "goal" or self._is_interrupted(part, sent) or self._reaches.has_ended(part, sent.id)
            )

        def has_changed() -> bool:
            return run != self._runs or is_known() or self._has_lost_controller(sent)

        while True:
            self._service.check_router()
            self._wait(has_changed)
            if run != self._runs:
                raise ActionInterrupted(f"{part}: robot_sim started a new run")
            if is_known():
                return sent
            if self._has_lost_controller(sent) and verb == "goal":
                sent = self._send_again(part, run, sent, **fields)
            elif self._has_lost_controller(sent) or not self._owns(part):
                self._epochs.pop(part, None)
                raise ActionInterrupted(f"{part}: the controller has ended, or gave its goal to another service")

    def _send_again(self, part: str, run: int, sent: Sent, **fields: object) -> Sent:
        """Continue an action whose controller has ended: send its goal to the next controller, once that has the part under control.

        As after a short hold (time without commands), the part rests on the path to its goal. Raises ActionInterrupted after
        SEND_AGAIN_WITHIN, an emergency stop, a new run or a request to rest: then the part must not move to an old goal.
        """
        self._epochs.pop(part, None)
        motion = self._motion.get(part)
        touched = frozenset(motion.touched) if motion is not None and motion.action_id == sent.id else frozenset()
        give_up = self._service.bus.t + round(SEND_AGAIN_WITHIN * 1e9)

        def is_ready() -> bool:
            return self._owns(part) and self._is_free(part)

        while True:
            self._service.check_router()
            self._take(part)
            self._wait(lambda: run != self._runs or is_ready())
            if self._was_stopped or self._is_resting or run != self._runs or self._service.bus.t > give_up:
                raise ActionInterrupted(f"{part}: the controller has ended, and the action cannot continue")
            if is_ready():
                try:
                    again = self._send(part, "goal", Goal, sent.id, **fields)
                except ActionInterrupted as refusal:
                    self._service.log.info("the goal is sent once more: %s", refusal)
                    self._wait(lambda: False)
                else:
                    self._service.bus.event("info", "sent_again", f"{part} continues its action with the new controller")
                    return replace(again, first_k=sent.first_k, touched=sent.touched | touched)

    def release(self, part: str) -> None:
        """Release the goal of the part, if this service owns it.

        Raises services.common.rpc.CallFailed if the controller does not answer or refuses the release.
        """
        epoch = self._epochs.pop(part, None)
        if epoch is not None:
            self._service.call(keys.goal(part, "release"), WithEpoch, Done, epoch=epoch)

    def rest(self) -> None:
        """Release all goals at once, and take none until `resume` is called; an action in progress raises ActionInterrupted.

        The presented target is removed from the model's world until the next reach, so that another service can present one.
        """
        self._is_resting = True
        self._wanted.clear()
        for part in list(self._epochs):
            with suppress(CallFailed):  # lost already, or there is no controller
                self.release(part)
        self._reaches.withdraw()

    def resume(self) -> None:
        """End the rest that `rest` has begun: goals may be taken again."""
        self._is_resting = False

    def idle(self) -> bool:
        """Return whether this plant rests: `rest` was called, and `resume` was not called since.

        If it rests, the method first waits for a call of `resume`, for at most 0.2 s (RETRY_PERIOD), and returns the state after this wait.
        """
        if self._is_resting:
            self._service.check_router()
            self._wait(lambda: not self._is_resting)
        return self._is_resting

    def pause(self, seconds: float) -> None:
        """Handle messages and calls for `seconds` of real time.

        Raises ActionInterrupted if `rest` was called, or if robot_sim started a new run.
        """
        run = self._runs
        self._service.check_router()
        self._wait(lambda: self._is_resting, seconds)
        if self._is_resting:
            raise ActionInterrupted("this service rests")
        if run != self._runs:
            raise ActionInterrupted("robot_sim started a new run")

    def leave(self) -> None:
        """Release all goals and remove the target; in lockstep, also report that later ticks need not wait for this service."""
        for part in list(self._epochs):
            self.release(part)
        self._reaches.withdraw()
        self._participant.done(self._service.bus.k, last=True)

    def _require_awake(self, part: str) -> None:
        if self._is_resting:
            raise ActionInterrupted(f"{part}: this service rests")

    def _wait(self, enough: Callable[[], bool], seconds: float = RETRY_PERIOD) -> None:
        """Run handlers for some seconds, or until `enough` returns True; answer the tick before waiting."""

        def may_continue() -> bool:
            if enough():
                return True
            self._answer()
            return False

        self._service.spin(time.monotonic() + seconds, may_continue)

    def _answer(self) -> None:
        """Report to robot_sim that this service has finished the tick for which robot_sim waits (lockstep).

        Tick 0 is answered only if this service owns the goals of all parts that it uses, or these parts are in hold. robot_sim repeats tick
        0 until it is answered.
        """
        if self._to_answer is None:
            return
        if self._to_answer > 0 or all(self._owns(part) or self._is_held(part) for part in self._wanted):
            self._participant.done(self._to_answer)
        self._to_answer = None

    def _note_turn(self, turn: Turn) -> None:
        self._tick = turn.dt * 1e-9
        self._to_answer = turn.k

    def _send(self, part: str, verb: str, request: type[Request], action_id: str, **fields: Any) -> Sent:
        """Call the controller to start an action of a part, and return the sent action.

        `verb`: last word of the call's key. `fields`: data of the request. Raises InvalidValue if the controller refuses the target because
        of the limits or the reach, ActionInterrupted if the call fails for another reason. While the robot is paused, a reach waits.
        """
        key = keys.goal(part, verb)
        while True:
            controllers = self._controllers()
            try:
                reply = self._service.call(key, request, Started, tries=TRIES, epoch=self._epochs[part], action_id=action_id, **fields)
            except CallFailed as error:
                if error.code == "paused":
                    self.pause(RETRY_PERIOD)
                    self.measure(part)  # after the pause the part is in hold for a moment
                    continue
                if error.code in ("limits", "reach"):
                    raise InvalidValue(str(error)) from None
                if error.code == "epoch":
                    del self._epochs[part]
                raise ActionInterrupted(f"{part}: {error}") from None
            return Sent(action_id, controllers, reply.k, reply.k)

    def _controllers(self) -> frozenset[str]:
        return frozenset(self._service.alive.get("controller", ()))

    def _has_lost_controller(self, sent: Sent) -> bool:
        return self._controllers().isdisjoint(sent.controllers)

    def _outcome(self, part: str, sent: Sent) -> Outcome:
        motion = self._motion[part]
        if self._is_interrupted(part, sent):
            raise ActionInterrupted(f"{part}: the part was in hold before the action ended")
        duration = (motion.since_k - sent.first_k) * self._tick
        return Outcome(np.array(motion.q), motion.status == "settled", duration, tuple(sorted({*sent.touched, *motion.touched})))

    def _is_over(self, part: str, sent: Sent) -> bool:
        motion = self._motion.get(part)
        if motion is None or motion.k <= sent.k:
            return False
        if motion.action_id != sent.id:  # a new controller does not know it
            return not self._has_lost_controller(sent)
        return motion.status not in ("moving", "suspended")

    def _is_interrupted(self, part: str, sent: Sent) -> bool:
        motion = self._motion[part]
        return motion.action_id != sent.id or motion.status == "held"

    def _is_free(self, part: str) -> bool:
        motion = self._motion.get(part)
        return motion is not None and motion.status != "held"

    def _is_held(self, part: str) -> bool:
        motion = self._motion.get(part)
        return motion is not None and motion.status == "held"

    def _owns(self, part: str) -> bool:
        motion = self._motion.get(part)
        return part in self._epochs and motion is not None and motion.epoch == self._epochs[part]

    def _take(self, part: str) -> None:
        waits_for_motion = part in self._epochs and part not in self._motion  # a new run: this service still owns the goal
        if self._owns(part) or waits_for_motion or not self._service.alive.get("controller"):
            return
        try:
            reply = self._service.call(keys.goal(part, "take"), Take, Taken, instance=self._service.instance)
        except CallFailed as error:
            if error.code == "owned":
                self._wait_for_owner(part, str(error))
            self._service.log.info("the goal of %s cannot be taken yet: %s", part, error)
            return
        self._refused_since.pop(part, None)
        self._epochs[part] = reply.epoch

    def _wait_for_owner(self, part: str, refusal: str) -> None:
        """Wait while the goal belongs to another service, which may have just ended; after OWNED_PATIENCE, raise MobeeError."""
        now = time.monotonic()
        if now - self._refused_since.setdefault(part, now) > OWNED_PATIENCE:
            raise MobeeError(refusal)

    def _noter(self, part: str) -> Callable[[Motion], None]:
        def note(motion: Motion) -> None:
            self._motion[part] = motion

        return note

    def _note_stop(self, stop: EStop) -> None:
        self._was_stopped = self._was_stopped or stop.set

    def _note_q(self, tick: Tick) -> None:
        self._q = np.array(tick.q)

    def _note_clock(self, clock: Clock) -> None:
        self._tick = clock.dt * 1e-9

    def _new_run(self) -> None:
        self._runs += 1
        self._motion.clear()
        self._q = None
        self._to_answer = None
