# SPDX-License-Identifier: Apache-2.0
"""The action of one part: owner, target, status."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bus_schema.messages import GateState, MotionStatus
from mobee.arrays import Array
from mobee.control import Settle, SettleTest

LONGEST_SUSPENSION = 10.0  # s of the bus clock; a service is back within 5 s
MOST_SUSPENSIONS = 5  # of one action: a part that is held again and again would never settle


@dataclass
class Owner:
    """The process that owns a part's goal while its liveliness token exists."""

    who: str
    instance: str
    epoch: int


class Action:
    """Goal ownership and action status of a part; times in s of the bus clock, ticks in k."""

    def __init__(self, settle: Settle) -> None:
        self._settle = settle
        self._test: SettleTest | None = None
        self.owner: Owner | None = None
        self.id = ""
        self.target: Array | None = None  # (n_part,) rad, to which the action may continue after a suspension
        self._suspended_at, self._suspensions = 0.0, 0  # s, of the last one; number in this action
        self.status: MotionStatus = "held"
        self.since_k = self.start_k = 0

    def start(self, action_id: str, k: int, t: float, target: Array | None = None) -> None:
        """Start an action whose goal was set at tick k, time t [s]; `target`: of an action that may be suspended."""
        self.id, self.start_k, self.target, self._suspensions = action_id, k, target, 0
        self.settle_again(k, t)

    @property
    def is_in_hold(self) -> bool:
        """Whether the part is not under control."""
        return self.status in ("held", "suspended")

    @property
    def is_under_way(self) -> bool:
        """Whether the action has not ended: the part moves, or will move again."""
        return self.status in ("moving", "suspended")

    def may_continue(self, t: float, gate: GateState) -> bool:
        """Return whether the action of a part that is in hold at time t [s] may continue when the part is under control again.

        A short hold leaves the part at rest on the path to its goal.  After an emergency stop or a fault, and after a long hold, it must
        not move to an old goal.
        """
        if self.target is None or gate in ("estop", "fault"):
            return False
        if self.status == "moving":
            return self._suspensions < MOST_SUSPENSIONS
        return self.status == "suspended" and t - self._suspended_at <= LONGEST_SUSPENSION

    def suspend(self, k: int, t: float) -> None:
        """Let the part rest at tick k, time t [s], without ending the action."""
        self._test, self._suspended_at = None, t
        self._suspensions += 1
        self._set_status("suspended", k)

    def settle_again(self, k: int, t: float) -> None:
        """Continue the action at tick k with a new settle test; it ends when the part has settled again."""
        self._test = SettleTest(self._settle, t)
        self._set_status("moving", k)

    def update(self, k: int, t: float, speeds: Array, accelerations: Array, continues: Callable[[], bool] = lambda: False) -> None:
        """Test whether the motion has settled, and set the status.

        Args:
            k: tick.
            t: its time, s.
            speeds: commanded speeds of the part's motors, (n_part,) rad/s; of motors that slide, in their fine units.
            accelerations: likewise, (n_part,) rad/s^2.
            continues: if it returns True, as for a reach that still comes nearer, a settled motion still counts as "moving".
        """
        if self._test is not None and self.status == "moving":
            verdict = self._test.update(t, speeds, accelerations)
            self._set_status("moving" if verdict == "settled" and continues() else verdict, k)

    def hold(self, k: int) -> None:
        """End the action without an outcome, because the part is not under control."""
        self._test = None
        self._set_status("held", k)

    def resume(self, k: int) -> None:
        """Set the status of a part that is under control again: at rest, without an action."""
        self.id = ""
        self._set_status("idle", k)

    def lose_owner(self, k: int) -> None:
        """End the action and the ownership, because the owner has ended."""
        self.owner, self._test = None, None
        if self.status == "suspended":
            self.hold(k)
        elif self.status != "held":
            self.resume(k)

    def _set_status(self, status: MotionStatus, k: int) -> None:
        if status != self.status:
            self.status, self.since_k = status, k


def busy_owners(actions: Iterable[Action]) -> list[str]:
    """Return the names of the services that have nothing to decide in this tick, because all their parts are moving."""
    owners: dict[str, bool] = {}
    for action in actions:
        if action.owner is not None:
            owners[action.owner.who] = owners.get(action.owner.who, True) and action.is_under_way
    return sorted(who for who, busy in owners.items() if busy)
