# SPDX-License-Identifier: Apache-2.0
"""Makes an agent wait for access to its file of transitions: until the disk has room, and until its earlier process has ended."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from mobee.errors import InUse, NoRoom
from services.common.service import Service

_T = TypeVar("_T")
PERIOD = 1.0  # s between two attempts
PREDECESSOR = 15.0  # s for which another process may write this agent's data: an agent without a router ends after 10 s


class StoreWait:
    """Repeats an access to the file of an agent's transitions (its store) until the access succeeds.

    The store refuses access while the disk is full, or while an earlier process of the agent still writes. Between the tries the calls of
    other services are answered, and the agent's part keeps its position.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self.waits_for = ""  # why this agent waits; empty: it does not

    def status_prefix(self) -> str:
        """Return the beginning of the agent's line in `mobee status`; empty if the agent does not wait for its store."""
        return f"waits: {self.waits_for}; " if self.waits_for else ""

    def until_accepted(self, act: Callable[[], _T]) -> _T:
        """Return the result of `act()`, which is repeated while the disk is full or an earlier process of this agent still writes.

        Raises InUse if that process still writes after PREDECESSOR (15 s), and every other error of `act`.
        """
        begun = time.monotonic()
        while True:
            try:
                result = act()
            except NoRoom as error:
                self._wait("no_room", error)
            except InUse as error:
                if time.monotonic() > begun + PREDECESSOR:
                    raise
                self._wait("in_use", error)
            else:
                break
        if self.waits_for:
            self._service.bus.event("info", "continues", f"the store accepts the data again after {time.monotonic() - begun:.0f} s")
            self.waits_for = ""
        return result

    def let_append_wait(self, store: Any) -> None:
        """Replace the method `append` of a store by one that repeats the call until the store accepts the data.

        It waits and raises errors like `until_accepted`.
        """
        append = store.append
        store.append = lambda *data: self.until_accepted(lambda: append(*data))

    def _wait(self, code: str, error: NoRoom | InUse) -> None:
        if not self.waits_for:
            self._service.bus.event("error", code, f"this agent waits: {error}")
        self.waits_for = str(error)
        self._service.spin(time.monotonic() + PERIOD)
        self._service.check_router()
