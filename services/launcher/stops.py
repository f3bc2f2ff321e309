# SPDX-License-Identifier: Apache-2.0
"""Keeps an emergency stop that robot_sim has not confirmed yet: writes it to disk, and repeats it on the bus."""

from __future__ import annotations

import time
from collections.abc import Callable

from bus_schema.authority import HOST_LAUNCHER
from bus_schema.messages import EStop
from services.common.emergency_stop import BY_LAUNCHER, Stop, StopLine, StopRecord, replaces
from services.common.service import Service

PERIOD = 0.05  # s between two checks for a stop, and between two repetitions
JUST_RELEASED = 0.2  # s after a release in which a stop may be older than it: it is left to robot_sim, and to its sender, who repeats it
JUST_CONFIRMED = 0.2  # s after a stop that robot_sim has published, which it repeats twice in that time, if it is stopped


class EmergencyStops:
    """The launcher's part in an emergency stop. It is needed because robot_sim may be dead, frozen or starting when a stop is sent.

    It writes the stop to a file, which a new robot_sim reads at its start. It repeats the stop on the bus until robot_sim confirms it:
    robot_sim then publishes the stop itself. This class never releases a stop.
    """

    def __init__(self, service: Service, record: StopRecord | None, announce: Callable[[str], None]) -> None:
        """Begin to watch for stops.

        `record`: record of stops on disk; None: robot_sim runs on another host. `announce`: called with each line that a user should see.
        """
        self._service, self._record, self._announce = service, record, announce
        self._publisher = service.bus.publisher(EStop)
        self._waiting: Stop | None = None  # for robot_sim's confirmation
        self._confirmed = -JUST_CONFIRMED  # s, monotonic clock: when robot_sim last published a stop
        self._line = StopLine(service.bus.session)
        self._watch()

    @property
    def waiting(self) -> str:
        """The emergency stop that robot_sim has not confirmed yet, as text; empty if there is none."""
        return "" if self._waiting is None else str(self._waiting)

    def stop(self, reason: str) -> None:
        """Stop the robot: record an emergency stop with this reason, and send it until robot_sim confirms it."""
        self._keep(Stop(BY_LAUNCHER, reason[:2000], time.time()))
        self._repeat()

    def _watch(self) -> None:
        was_waiting = self._waiting
        for message in self._line.take():
            self._note(message)
        if self._waiting is was_waiting:  # a new stop is left to robot_sim first: a repetition could come after its release
            self._repeat()
        self._service.inbox.at(time.monotonic() + PERIOD, self._watch)

    def _note(self, message: EStop) -> None:
        if message.src == "robot_sim":
            self._waiting, self._confirmed = None, time.monotonic()
        elif not self._is_launcher(message.src) and not self._was_just_confirmed() and not self._was_just_released():
            stop = Stop(message.source, message.reason, time.time())
            if replaces(stop, self._waiting):
                self._keep(stop)

    def _is_launcher(self, who: str) -> bool:
        """Return whether `who`, the sender of a stop, is a launcher. A stop from a launcher is ignored.

        Reason: every launcher repeats the stops that it knows, so two launchers would repeat each other's stops without end.
        """
        return who == self._service.who or who == BY_LAUNCHER or who.startswith(HOST_LAUNCHER)

    def _was_just_confirmed(self) -> bool:
        """Return whether robot_sim has published an emergency stop during the last 0.2 s, thus is stopped or was a moment ago.

        A stop that arrives in this time is ignored: the launcher could repeat it after the release, and so stop the robot again.
        """
        return time.monotonic() - self._confirmed < JUST_CONFIRMED

    def _was_just_released(self) -> bool:
        """Return whether robot_sim has recorded a release a moment ago, by the clock of this host, which is also robot_sim's."""
        if self._record is None:
            return False
        return 0 <= time.monotonic_ns() - self._record.released_at() < 1e9 * JUST_RELEASED

    def _keep(self, stop: Stop) -> None:
        self._waiting = stop
        if self._record is None:
            return
        if replaces(stop, self._record.read()):
            try:
                self._record.latch(stop)
            except OSError as error:
                self._announce(f"the emergency stop is repeated, but {self._record.path} was not written: {error.strerror}")

    def _repeat(self) -> None:
        if self._waiting is not None:
            self._publisher.put(set=True, source=self._waiting.source, reason=self._waiting.reason)
