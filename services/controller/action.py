# SPDX-License-Identifier: Apache-2.0
"""The action of one part (a motion that a client has started), its status and its owner."""

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
    """The process that owns a part's goal (the right to set its attractor), as long as its liveliness token exists.

    `who`: name of the service. `instance`: id of the process, the last chunk of its token. `epoch`: number of this ownership; each new
    owner gets a larger one, and must send it with its calls.
    """

    who: str
    instance: str
    epoch: int


class Action:
    """The owner of a part's goal (the right to set its attractor), and the part's newest action with its status.

    `id`: id of the action; empty: none. `status`: idle, moving, settled, timeout, suspended or held. If it is suspended or held, the part
    stands still and does not follow the controller's commands; a suspended action may continue later, a held one has ended. `since_k`: tick
    at which the status began. `start_k`: tick at which the action began. Times are in s of the bus clock.
    """

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
        """Start an action whose goal was set at tick k, at the time t [s].

        `action_id`: text that identifies the action in messages. `target`: (n_part,) rad, the attractor to which the action may continue
        after a suspension; None: it cannot continue.
        """
        self.id, self.start_k, self.target, self._suspensions = action_id, k, target, 0
        self.settle_again(k, t)

    @property
    def is_in_hold(self) -> bool:
        """Whether robot_sim does not follow the controller's commands to the part: its status is "held" or "suspended"."""
        return self.status in ("held", "suspended")

    @property
    def is_under_way(self) -> bool:
        """Whether the action has not ended: its status is "moving", or "suspended", after which the part will move again."""
        return self.status in ("moving", "suspended")

    def may_continue(self, t: float, gate: GateState) -> bool:
        """Return whether the action may continue after a hold, in which the part stands still and follows no commands of the controller.

        An action that has ended, or that has no target, cannot continue. Nor can one after an emergency stop or a fault, after a hold of
        more than 10 s, or at the sixth hold of the action: the part must not move to an old goal then. `t`: present time [s]. `gate`: state
        of the part's safety gate in robot_sim.
        """
        if self.target is None or gate in ("estop", "fault"):
            return False
        if self.status == "moving":
            return self._suspensions < MOST_SUSPENSIONS
        return self.status == "suspended" and t - self._suspended_at <= LONGEST_SUSPENSION

    def suspend(self, k: int, t: float) -> None:
        """Interrupt the action at tick k, at the time t [s], without ending it; its status is then "suspended"."""
        self._test, self._suspended_at = None, t
        self._suspensions += 1
        self._set_status("suspended", k)

    def settle_again(self, k: int, t: float) -> None:
        """Set the status "moving" again at tick k, at the time t [s]; the action then ends when the part settles or times out."""
        self._test = SettleTest(self._settle, t)
        self._set_status("moving", k)

    def update(self, k: int, t: float, speeds: Array, accelerations: Array, continues: Callable[[], bool] = lambda: False) -> None:
        """Test whether the motion of the part has settled or timed out, and set the status accordingly.

        Args:
            k: tick.
            t: time of the tick, s.
            speeds: commanded speeds of the part's motors, (n_part,) rad/s. For a motor that slides, give the speed [m/s] divided by the
                distance [m] that counts as 1 rad for this motor, as `mobee.robot.motor_units.fine_units` gives it.
            accelerations: commanded accelerations, (n_part,) rad/s^2, divided likewise for motors that slide.
            continues: called when the motion has settled; if it returns True, for example because a marker still comes nearer to its
                target, the status stays "moving".
        """
        if self._test is not None and self.status == "moving":
            verdict = self._test.update(t, speeds, accelerations)
            self._set_status("moving" if verdict == "settled" and continues() else verdict, k)

    def hold(self, k: int) -> None:
        """End the action at tick k because the part does not follow the control law. Its status is "held", not "settled" or "timeout"."""
        self._test = None
        self._set_status("held", k)

    def resume(self, k: int) -> None:
        """Set the status "idle" at tick k: the part follows the control law, but has no action."""
        self.id = ""
        self._set_status("idle", k)

    def lose_owner(self, k: int) -> None:
        """End the action and the ownership at tick k: the part has no owner then."""
        self.owner, self._test = None, None
        if self.status == "suspended":
            self.hold(k)
        elif self.status != "held":
            self.resume(k)

    def _set_status(self, status: MotionStatus, k: int) -> None:
        if status != self.status:
            self.status, self.since_k = status, k


def busy_owners(actions: Iterable[Action]) -> list[str]:
    """Return the sorted names of the owners that need not act in this tick, because the actions of all their parts continue.

    An owner is a service that owns the goal of at least one part. An action continues while it is "moving" or "suspended".
    """
    owners: dict[str, bool] = {}
    for action in actions:
        if action.owner is not None:
            owners[action.owner.who] = owners.get(action.owner.who, True) and action.is_under_way
    return sorted(who for who, busy in owners.items() if busy)
