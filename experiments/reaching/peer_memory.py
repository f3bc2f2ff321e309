"""What a planner peer remembers of earlier motions: poses to keep away from, for good or for one target."""

from __future__ import annotations

import numpy as np

from experiments.reaching.peer_belief import NEAR
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

Knowledge = tuple[list[Array], dict[bytes, list[Array]]]


class PeerMemory:
    """Poses of the motors, (d,) rad; where the target was touched they count for it alone, as thesis 9.4.1 tells body from workspace.

    `span`: (d,) rad, how wide the motors' ranges are.
    """

    def __init__(self, span: Array) -> None:
        self._span = span
        self._for_good: list[Array] = []
        self._at_target: dict[bytes, list[Array]] = {}

    def __len__(self) -> int:
        return len(self._for_good) + sum(map(len, self._at_target.values()))

    def knowledge(self) -> Knowledge:
        """All of it, to be given to `restore`."""
        return list(self._for_good), {place: list(poses) for place, poses in self._at_target.items()}

    def restore(self, knowledge: Knowledge) -> None:
        """Remember that, and nothing else."""
        self._for_good, self._at_target = list(knowledge[0]), {place: list(poses) for place, poses in knowledge[1].items()}

    def clear(self) -> None:
        """Forget everything."""
        self.restore(([], {}))

    def blocked(self, aim: Array, end: Array, target: ReachTarget, touched: bool) -> None:
        """A motion to `aim` ended elsewhere: keep away from where it would have gone next, from its aim if it was nearly there."""
        left = (aim - end) / self._span
        ahead = end + min(1.0, NEAR / max(float(np.linalg.norm(left)), 1e-9)) * (aim - end)
        if touched:
            self.missed(ahead, target)
        else:
            self._for_good.append(ahead)

    def missed(self, pose: Array, target: ReachTarget) -> None:
        """Keep away from a pose where it is this target that is reached for."""
        self._at_target.setdefault(place_of(target), []).append(pose)

    def of(self, target: ReachTarget) -> tuple[Array, Array]:
        """What is to be kept away from: all, and what is left if that leaves no way, which is this target's alone; (B, d) rad each."""
        here = self._at_target.get(place_of(target), [])
        everything, alone = (np.array(poses).reshape(-1, len(self._span)) for poses in (self._for_good + here, here))
        return everything, alone


def place_of(target: ReachTarget) -> bytes:
    """The same for targets at the same place."""
    return target.position.tobytes()
