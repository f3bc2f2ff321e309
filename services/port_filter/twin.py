"""Forwards calls that need no judgement: metadata, emergency stop, liveliness."""

from __future__ import annotations

from typing import Any

from bus_schema import keys
from bus_schema.messages import EStop
from bus_schema.rpc import Done, Empty, PartMeta
from mobee.robot.robot import Robot
from services.common.inbox import CROWDED_WITH_STOPS
from services.common.rpc import CallFailed
from services.common.service import CallRefused, Service


class HandThrough:
    """Between the robot (`service`) and its filtered twin."""

    def __init__(self, service: Service, twin: Service, robot: Robot) -> None:
        self._service, self._twin = service, twin
        self._router: dict[str, Any] = {}  # tokens by instance
        self._down = twin.bus.publisher(EStop, delivery="LATEST")
        self._up = service.bus.publisher(EStop, delivery="LATEST")
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
        """A client without a router ends itself: in its namespace too there must be one."""
        if who != "router":
            return
        if up:
            token = self._twin.bus.session.liveliness().declare_token(keys.alive(who, instance))
            self._router[instance] = token
        elif instance in self._router:
            self._router.pop(instance).undeclare()
