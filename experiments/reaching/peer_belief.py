"""What the planner peer believes of robot and world, and which poses and motions it therefore holds for sound."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee import Gains, Model, sphere
from mobee.pose import Pose
from mobee.reach import TARGET, ReachTarget
from mobee.robot.robot import Array, Clause, Ints

STEP = 0.02  # of a motor's range, between two poses of a motion that are looked at
NEAR = 0.08  # of the motors' ranges: a pose that near to one where a motion was blocked is held for blocked
Care = Literal["grasping", "solids", "fields"]
"""What must not touch anything: the solids but for the hand at the target; all solids; also the fields but for the hand's there."""


class PeerBelief:
    """Sound is a pose within the limits that violates no known clause and touches nothing, as far as is believed.

    Args:
        model: the robot in the world as believed, which nobody else edits.
        motors: d of them, with which motions are planned; the others stay at home.
        marker: what is to come to the target.
        clauses: those that are known.
        gains: of the law under which motions are executed.
        turns: (d,) rad, by how much the motors are believed to stand elsewhere than the encoders say.
    """

    def __init__(
        self, model: Model, motors: Sequence[str], marker: str, clauses: Sequence[Clause], gains: Gains, turns: Array | None = None
    ) -> None:
        self.model, self.marker = model, marker
        robot = model.robot
        self.columns = np.array([robot.motor_index(name) for name in motors])
        width = np.array([gains.of_motors("limit_width", robot.motors)[i] for i in self.columns])
        self.limits: Array = robot.limits[self.columns] + width[:, None] * np.array([1.0, -1.0])
        """(d, 2) rad, between which the joint limits exert no force."""
        self.range: Array = robot.limits[self.columns]
        """(d, 2) rad, of the motors."""
        self.span: Array = np.ptp(robot.limits[self.columns], axis=1)
        """(d,) rad, how wide the ranges are."""
        self.turns = np.zeros(len(motors)) if turns is None else turns
        self.blocked: Array = np.zeros((0, len(motors)))
        """(B, d) rad, poses to keep away from."""
        self.looks = 0
        """How many poses were looked at."""
        self._clauses = tuple(clauses)
        self._spared = self._hand()

    def present(self, target: ReachTarget) -> None:
        """Put the target where it is believed to be."""
        world = self.model.world
        if TARGET in world.objects:
            world.remove(TARGET)
        world.add(TARGET, sphere(target.radius), position=target.position, role="target")

    def whole(self, q: Array) -> Array:
        """Poses of the motors (..., d), by their encoders, as poses of the robot (..., n), as believed; rad."""
        home = self.model.robot.home
        poses = np.empty((*q.shape[:-1], len(home)))
        poses[...] = home
        poses[..., self.columns] = q + self.turns
        return poses

    def sound(self, q: Array, care: Care = "solids") -> NDArray[np.bool_]:
        """Which of the poses (P, d) rad are."""
        self.looks += len(q)
        poses = self.whole(q)
        good = self._allowed(q, poses)
        good[self._touching(poses, care)] = False
        return good

    def sound_motion(self, start: Array, end: Array, care: Care = "solids") -> bool:
        """Whether all of the straight way between two poses (d,) rad is; where it starts does not count."""
        count = max(1, int(np.ceil(np.abs((end - start) / self.span).max() / STEP)))
        shares = np.arange(1, count + 1)[:, None] / count
        q = start + shares * (end - start)
        self.looks += count
        poses = self.whole(q)
        return bool(self._allowed(q, poses).all()) and not len(self._touching(poses, care))

    def _allowed(self, q: Array, poses: Array) -> NDArray[np.bool_]:
        """Which of the poses are within the limits, violate no clause and are away from what was blocked."""
        good: NDArray[np.bool_] = ((q >= self.range[:, 0] - 1e-9) & (q <= self.range[:, 1] + 1e-9)).all(axis=1)
        for clause in self._clauses:
            good &= (poses @ clause.a.T + clause.b).max(axis=1) >= 0.0
        if len(self.blocked):
            away = (q[:, None] - self.blocked) / self.span
            good &= (np.sqrt((away * away).sum(axis=2)) > NEAR).all(axis=1)
        return good

    def _touching(self, poses: Array, care: Care) -> Ints:
        """The numbers of those poses (P, n) that touch something."""
        table = self._felt(poses, reaching=care == "grasping").table
        felt = table.kind == 0
        if care == "fields":  # the hand's may be in the target
            target = len(table.shapes) + table.objects.index(TARGET) if TARGET in table.objects else -1
            felt |= (table.second != target) | ~self._spared[table.first_link]
        touching: Ints = table.pose[felt]
        return touching

    def push(self, q: Array) -> Array:
        """How much the fields push in poses (P, d) rad while the marker reaches: the size of their J^T force, (P,)."""
        size: Array = np.linalg.norm(self._felt(self.whole(q), reaching=True).projection[:, self.columns], axis=1)
        return size

    def _hand(self) -> NDArray[np.bool_]:
        """Of which links (L,) no field feels the target while the marker reaches."""
        first = self.model.hand(self.marker).fields
        spared = np.zeros(len(self.model.robot.links), dtype=np.bool_)
        for link in range(first, len(spared)):  # what carries a link has a smaller number
            spared[link] = link == first or spared[self.model.robot.joints[link - 1].parent]
        return spared

    def _felt(self, poses: Array, reaching: bool) -> Pose:
        """The poses (P, n) rad; `reaching`: the hand does not feel the target."""
        self.model.reaching = self.marker if reaching else None
        return self.model.evaluate(poses)
