"""Where the robot has been lately: a circular buffer of poses with waypoints (thesis 4.1)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from mobee.robot.robot import Array


@dataclass(slots=True)
class _Entry:
    q: Array
    is_waypoint: bool = False


class History:
    """The newest poses (n,), the oldest forgotten first; some are marked as waypoints."""

    def __init__(self, capacity: int) -> None:
        self._entries: deque[_Entry] = deque(maxlen=capacity)

    def __len__(self) -> int:
        return len(self._entries)

    def append(self, q: Array) -> None:
        """Record where the robot is."""
        self._entries.append(_Entry(q.copy()))

    def mark(self) -> bool:
        """Make the newest pose a waypoint; False when there is none."""
        if not self._entries:
            return False
        self._entries[-1].is_waypoint = True
        return True

    def undo(self) -> tuple[Array, bool]:
        """Take the newest pose out: the pose, and whether it is a waypoint."""
        entry = self._entries.pop()
        return entry.q, entry.is_waypoint

    def keep(self, q: Array) -> None:
        """Put back the pose at which a rewinding ended, as a waypoint: it is where the next motion begins."""
        self._entries.append(_Entry(q, is_waypoint=True))
