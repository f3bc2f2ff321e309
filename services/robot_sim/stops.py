"""How long a part that must hold takes to stop, and how far it goes, on robot_sim's own clock."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mobee.robot.robot import Array

MOVING = np.deg2rad(1.0)  # rad/s, below it a part is at rest


@dataclass(slots=True)
class Stops:
    """The stop that each part is in, and the worst of those that ended."""

    count: int = 0
    time_max: float = 0.0  # s
    distance_max: float = 0.0  # rad
    _commanded: dict[str, tuple[int, Array]] = field(default_factory=dict)  # ns and q at the last tick under command, of parts that moved

    def obeys(self, part: str, now: int, q: Array, moves: bool) -> None:
        """The part follows a command now [ns], at q (n,) rad, which nobody changes; `moves`: some motor is faster than MOVING."""
        if moves:
            self._commanded[part] = (now, q)
        else:
            self._commanded.pop(part, None)

    def look(self, part: str, now: int, q: Array, moves: bool) -> tuple[float, float] | None:
        """(time [s], distance [rad]) since the last command, once, when the part has come to rest just now."""
        if moves or part not in self._commanded:
            return None
        start, q_start = self._commanded.pop(part)
        time, distance = (now - start) / 1e9, float(np.abs(q - q_start).max())
        self.count += 1
        self.time_max, self.distance_max = max(self.time_max, time), max(self.distance_max, distance)
        return time, distance

    def forget(self) -> None:
        """A new run."""
        self._commanded.clear()
