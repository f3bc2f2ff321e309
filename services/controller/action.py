"""The action of one part: owner, target, state."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bus_schema.messages import MotionStatus
from mobee.arrays import Array
from mobee.control import Settle, SettleTest


@dataclass
class Owner:
    """One process, as long as its token lives."""

    who: str
    instance: str
    epoch: int


class Action:
    """Goal ownership and action state of a part; times in s of the bus clock, ticks in k."""

    def __init__(self, settle: Settle) -> None:
        self._settle = settle
        self._test: SettleTest | None = None
        self.owner: Owner | None = None
        self.id = ""
        self.status: MotionStatus = "held"
        self.since_k = self.start_k = 0

    def start(self, action_id: str, k: int, t: float) -> None:
        """A goal was set at tick k."""
        self.id, self.start_k = action_id, k
        self.go_on(k, t)

    def go_on(self, k: int, t: float) -> None:
        """The same action has to settle once more, from tick k on."""
        self._test = SettleTest(self._settle, t)
        self._become("moving", k)

    def look(self, k: int, t: float, speeds: Array, accelerations: Array, is_under_way: Callable[[], bool] = lambda: False) -> None:
        """See whether the motion has died down; `is_under_way`: whether an action that has settled is not over all the same."""
        if self._test is not None and self.status == "moving":
            verdict = self._test.look(t, speeds, accelerations)
            self._become("moving" if verdict == "settled" and is_under_way() else verdict, k)

    def hold(self, k: int) -> None:
        """The part is not under control: whatever was going on ended without an outcome."""
        self._test = None
        self._become("held", k)

    def resume(self, k: int) -> None:
        """Under control again, at rest, with nothing to do."""
        self.id = ""
        self._become("idle", k)

    def drop(self, k: int) -> None:
        """The owner is gone: its action ends, the part stays."""
        self.owner, self._test = None, None
        if self.status != "held":
            self.resume(k)

    def _become(self, status: MotionStatus, k: int) -> None:
        if status != self.status:
            self.status, self.since_k = status, k


def busy_owners(actions: Iterable[Action]) -> list[str]:
    """Services with nothing to decide: every part that they own is moving."""
    owners: dict[str, bool] = {}
    for action in actions:
        if action.owner is not None:
            owners[action.owner.who] = owners.get(action.owner.who, True) and action.status == "moving"
    return sorted(who for who, busy in owners.items() if busy)
