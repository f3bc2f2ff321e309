# SPDX-License-Identifier: Apache-2.0
"""Forwards calls, part metadata, emergency stops and the sign that the router runs between robot_sim and its clients.

This sign is the router's liveliness token. The port filter is a process between robot_sim and the clients; it moves the robot back if a
motion leads into contact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from bus_schema import keys
from bus_schema.messages import EStop
from bus_schema.rpc import Done, Driven, Empty, PartMeta, Take, Taken, WithEpoch
from mobee.robot.robot import Robot
from services.common.inbox import CROWDED_WITH_STOPS
from services.common.rpc import CallFailed
from services.common.service import CallRefused, Service


@dataclass(frozen=True, slots=True)
class Owner:
    """The client that owns the drive of a part (the right to command its motors).

    It remains the owner at most as long as its liveliness token (the sign on the bus that it runs) exists. `who`: name of the client.
    `instance`: id of its process.
    """

    who: str
    instance: str


class DriveServer:
    """Forwards the drive calls of clients to robot_sim, unless the reflex is active.

    It belongs to the port filter, a process between the clients and robot_sim. The reflex moves the robot back along its past poses after a
    violation (a contact, or a pose beyond limits or clauses, which are constraints on several joints). The calls are take, arm, release,
    and hold, which stops a part. A client that takes a drive (the right to command a part's motors) gets the epoch (number of the
    ownership) that robot_sim has given to the port filter. `epochs`: dict from a part to the newest of these epochs; 0: none yet.
    """

    def __init__(
        self,
        service: Service,
        twin: Service,
        robot: Robot,
        refusal: Callable[[], str],
        is_moved_back: Callable[[str], bool],
        on_arm: Callable[[], None],
    ) -> None:
        """Begin to answer the calls of the clients.

        `service`: client of the robot. `twin`: acts as the robot in the namespace of the clients. `refusal`: returns the reason why no
        client may drive now; empty: clients may drive. `is_moved_back`: returns whether the reflex moves a part now, so that the filter
        must keep its drive. `on_arm`: called when a client has armed a part.
        """
        self._service, self._twin, self._refusal, self._on_arm = service, twin, refusal, on_arm
        self._is_moved_back = is_moved_back
        self._owners: dict[str, Owner | None] = dict.fromkeys(robot.parts)
        self.epochs: dict[str, int] = dict.fromkeys(robot.parts, 0)
        twin.on_request(keys.drive("*", "take"), Take, self._take, part_of_key=True)
        for verb in ("arm", "release", "hold"):
            twin.on_request(keys.drive("*", verb), WithEpoch, self._drive, part_of_key=True)
        twin.on_alive(self._note_alive)

    def forget(self) -> None:
        """Forget all owners and epochs (numbers of ownerships), because a new run has begun."""
        self._owners = dict.fromkeys(self._owners)
        self.epochs.update(dict.fromkeys(self.epochs, 0))

    def hold(self, part: str) -> None:
        """Stop a part: ask robot_sim to put it in hold, in which it brakes and stands still.

        If a client owns the part, it remains the owner, and must make the call `arm` before the part moves again. If no client owns the
        part, it is released at robot_sim, so that any client may take it. If the call of robot_sim fails, a warning is logged.

        If robot_sim does not run, nothing is done, because at its start all parts stand still and have no owners.
        """
        if not self._service.alive.get("robot_sim"):
            return
        try:
            self._call(part, "hold" if self._owners[part] else "release")
        except CallFailed as failed:
            self._service.log.warning("%s cannot be held: %s", part, failed)

    def _call(self, part: str, verb: str) -> Driven:
        return self._service.call(keys.drive(part, verb), WithEpoch, Driven, epoch=self.epochs[part])

    def _take(self, request: Take, key: str) -> Taken:
        part = key.split("/")[0]
        self._refuse_while_cut(part)
        owner = self._owners[part]
        if owner is not None and owner.instance != request.instance and owner.instance in self._twin.alive.get(owner.who, ()):
            raise CallRefused("owned", f"{part} belongs to {owner.who}, which is running and must release it first")
        with _forwarded():
            taken = self._service.call(keys.drive(part, "take"), Take, Taken, instance=self._service.instance)
        self._owners[part], self.epochs[part] = Owner(request.who, request.instance), taken.epoch
        return taken

    def _drive(self, request: WithEpoch, key: str) -> Driven:
        part, verb = key.split("/")[0], key.split("/")[-1]
        owner = self._owners[part]
        if owner is None or request.epoch != self.epochs[part]:
            raise CallRefused("epoch", f"{part}: epoch {request.epoch} does not own it; take it first")
        if verb == "arm":
            self._refuse_while_cut(part)
            if owner.instance not in self._twin.alive.get(owner.who, ()):
                raise CallRefused("no_token", f"{part}: no liveliness token alive/{owner.who}/{owner.instance}: declare it, then arm")
        if verb == "release":
            self._owners[part] = None
        if self._is_moved_back(part) or (self._refusal() and verb != "release"):
            return Driven(v=request.v, gate="hold")  # as the clients see it; the reflex keeps the drive
        with _forwarded():
            driven = self._call(part, verb)
        if driven.gate == "armed":
            self._on_arm()
        return driven

    def _refuse_while_cut(self, part: str) -> None:
        if why := self._refusal():
            raise CallRefused("reflex", f"{part}: {why}")

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        for part, owner in self._owners.items():
            if not up and owner == Owner(who, instance):
                self._service.bus.event("warning", "client_gone", f"{who} is gone: {part} holds")
                self._owners[part] = None
                if not self._is_moved_back(part):
                    self.hold(part)


@contextmanager
def _forwarded() -> Iterator[None]:
    """Refuse a client's call inside the `with` block if robot_sim refuses it, with the same code and text."""
    try:
        yield
    except CallFailed as failed:
        raise CallRefused(failed.code, str(failed)) from None


class Forwarder:
    """Forwards part metadata, emergency stops and the router's liveliness token (sign that it runs) between the robot and the clients.

    `service`: connection in the robot's namespace, in which the filter is a client of the robot. `twin`: connection in the namespace of the
    clients (first part of all their keys), in which the filter acts as the robot.
    """

    def __init__(self, service: Service, twin: Service, robot: Robot) -> None:
        self._service, self._twin = service, twin
        self._router: dict[str, Any] = {}  # tokens by instance
        self._down = twin.bus.publisher(EStop)
        self._up = service.bus.publisher(EStop)
        service.on_each(EStop, self._stop_clients, any_run=True, crowd=CROWDED_WITH_STOPS)
        twin.on_each(EStop, self._stop_robot, any_run=True, crowd=CROWDED_WITH_STOPS)
        twin.on_request(keys.ESTOP_RESET, Empty, lambda request, key: self._ask(key, Done))
        for part in robot.parts:
            twin.on_request(keys.meta(part), Empty, lambda request, key: self._ask(key, PartMeta))
        service.on_alive(self._note_alive)

    def _ask(self, key: str, reply: type[Any]) -> Any:
        try:
            return self._service.call(key, Empty, reply)
        except CallFailed as failed:
            raise CallRefused(failed.code, str(failed)) from None

    def _stop_clients(self, stop: EStop) -> None:
        if stop.src != self._service.who:
            self._down.put(set=stop.set, source=stop.source, reason=stop.reason)

    def _stop_robot(self, stop: EStop) -> None:
        if stop.src != self._twin.who:
            self._up.put(set=stop.set, source=stop.source, reason=stop.reason)

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        """Declare the router's liveliness token (sign that it runs) for the clients too: a client that sees no router ends.

        It is declared in the clients' namespace while it exists in the robot's namespace.
        """
        if who != "router":
            return
        if up:
            token = self._twin.bus.session.liveliness().declare_token(keys.alive(who, instance))
            self._router[instance] = token
        elif instance in self._router:
            self._router.pop(instance).undeclare()
