"""What happened in the ticks of an offline plant."""

from __future__ import annotations

from dataclasses import dataclass

from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A row a tick: what was measured and commanded in it, where the joints were at its end, and how deep contacts were."""

    encoders: Array  # (ticks, n) rad
    q: Array  # (ticks, n) rad, joint sides
    velocity: Array  # (ticks, n) rad/s, the controller's own
    solid: Array  # (ticks,) m, the deepest contact of solids at the encoders' pose, 0 without any
    field: Array  # (ticks,) m, of fields

    @classmethod
    def of(cls, record: Array) -> Trace:
        """From the loop's record, (ticks, 3 n + 2)."""
        n = (record.shape[1] - 2) // 3
        return cls(record[:, :n], record[:, n : 2 * n], record[:, 2 * n : 3 * n], record[:, 3 * n], record[:, 3 * n + 1])

    def __len__(self) -> int:
        return len(self.q)
