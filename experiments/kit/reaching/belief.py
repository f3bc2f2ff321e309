"""The belief of the planner peer: sound poses and motions, inverse kinematics to a target, and RRT-Connect between poses.

Inverse kinematics by damped least squares with restarts, all of them at once (Wampler 1986); `kit.reaching.targets.nearest_pose` finds
one nearest pose.  OMPL's RRT-Connect (Kuffner and LaValle 2000), and shortcuts of its paths (Geraerts and Overmars 2007).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee import Gains, Model, sphere
from mobee.arrays import Array, Ints
from mobee.model.pose import Pose
from mobee.reach import TARGET, ReachTarget
from mobee.roadmap.ompl import EXTENSIONS, connected
from mobee.robot.robot import Clause

STEP = 0.02  # of a motor's range, between two poses of a motion that are checked
NEAR = 0.08  # of the motors' ranges: a pose that near to one where a motion was blocked counts as blocked
Care = Literal["grasping", "solids", "fields"]
"""What must not touch anything: the solids but for the hand at the target; all solids; also the fields but for the hand's there."""


class PeerBelief:
    """A robot and a world as believed; a pose is sound if it is within the limits, violates no known clause and touches nothing.

    Args:
        model: the robot in the world as believed, which nobody else edits.
        motors: d of them, with which motions are planned; the others stay at home.
        marker: what is to come to the target.
        clauses: those that the planner knows.
        gains: of the law under which motions are executed.
        turns: (d,) rad, believed minus measured angles of the motors.
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
        self.checked = 0
        """How many poses were checked."""
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
        """Which of the poses (P, d) rad are sound, (P,)."""
        self.checked += len(q)
        poses = self.whole(q)
        good = self._allowed(q, poses)
        good[self._touching(poses, care)] = False
        return good

    def sound_motion(self, start: Array, end: Array, care: Care = "solids") -> bool:
        """Whether the whole straight path between two poses (d,) rad is sound; its start does not count."""
        count = max(1, int(np.ceil(np.abs((end - start) / self.span).max() / STEP)))
        shares = np.arange(1, count + 1)[:, None] / count
        q = start + shares * (end - start)
        self.checked += count
        poses = self.whole(q)
        return bool(self._allowed(q, poses).all()) and not len(self._touching(poses, care))

    def _allowed(self, q: Array, poses: Array) -> NDArray[np.bool_]:
        """Which of the poses are within the limits, violate no clause and are away from what was blocked."""
        good: NDArray[np.bool_] = np.all((q >= self.range[:, 0] - 1e-9) & (q <= self.range[:, 1] + 1e-9), axis=1)
        for clause in self._clauses:
            np.logical_and(good, (poses @ clause.a.T + clause.b).max(axis=1) >= 0.0, out=good)
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
        return self.model.evaluate(poses, reaching=self.marker if reaching else None)


RESTARTS, STEPS = 64, 40  # of inverse kinematics
ENOUGH = 0.5  # of the starts that have arrived: then the others are given up
DAMPING = 0.03  # m/rad
LONGEST = 0.25  # rad a step, of each motor
ARRIVED, ALMOST = 2e-3, 0.01  # m: the accepted error, and that accepted if no pose is better
KEPT = 12  # of the poses found: those that fields push least away
RETREAT, CLEAR = 0.02, 0.2  # m a step away from the target, and how far at most


def goals(belief: PeerBelief, target: ReachTarget, rng: np.random.Generator, most: int = KEPT, free: bool = False) -> tuple[Array, Array]:
    """Poses with the marker on the target, and poses before them, clear of it, from which the hand goes straight there: (K, d) rad each.

    At most so many, those that fields push least; where joint limits push, only if there are no others, and not if they are to be `free`.
    """
    within = target.radius if target.aim == "surface" else 0.0
    trials = ((belief.limits, ARRIVED), (belief.range, ARRIVED), (belief.range, ALMOST))
    for limits, enough in trials[:1] if free else trials:
        starts = rng.uniform(limits[:, 0], limits[:, 1], (RESTARTS, len(limits)))
        found, missing = approach(belief, starts, target.position, within, limits)
        found = found[missing <= enough]
        found = found[belief.sound(found, "grasping")] if len(found) else found
        if len(found):
            break
    found = found[np.argsort(belief.push(found), kind="stable")] if len(found) else found
    poses: list[Array] = []
    befores: list[Array] = []
    for pose in found:
        if len(poses) == most:
            break
        before = retreat(belief, pose, target.position)
        if before is not None:
            poses.append(pose)
            befores.append(before)
    empty = np.zeros((0, len(belief.columns)))
    return np.array(poses) if poses else empty, np.array(befores) if befores else empty


def approach(belief: PeerBelief, starts: Array, place: Array, within: float, limits: Array, steps: int = STEPS) -> tuple[Array, Array]:
    """From starts (K, d) rad draw the marker to within a distance [m] of a place (3,) m, the motors within limits (d, 2).

    Returns poses (K, d), and the remaining errors, (K,) m.
    """
    q = starts.copy()
    low, high = limits.T
    for _ in range(steps):
        whole = belief.whole(q)
        error, missing = _error(belief, whole, place, within)
        if (missing <= 0.1 * ARRIVED).mean() >= ENOUGH:
            break
        jacobian = belief.model.jacobian(whole, belief.marker)[:, :3, belief.columns]
        damped = jacobian @ jacobian.transpose(0, 2, 1) + DAMPING**2 * np.eye(3)
        step = np.einsum("kij,ki->kj", jacobian, np.linalg.solve(damped, error[..., None])[..., 0])
        step *= np.minimum(1.0, LONGEST / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
        q = np.clip(q + step, low, high)
    return q, _error(belief, belief.whole(q), place, within)[1]


def retreat(belief: PeerBelief, pose: Array, place: Array) -> Array | None:
    """A pose on the marker's straight path out of the target: the first in which nothing touches a field, else none touches a solid."""
    whole = belief.whole(pose)
    here = belief.model.evaluate(whole).position(belief.marker)
    out = here - place
    out = out / max(float(np.linalg.norm(out)), 1e-9)
    q: Array = pose
    found: Array | None = None
    for step in range(1, round(CLEAR / RETREAT) + 1):
        before = q
        q = approach(belief, q[None], here + step * RETREAT * out, 0.0, belief.range, steps=4)[0][0]
        if not belief.sound_motion(before, q, "grasping"):
            break
        if belief.sound(q[None], "solids" if found is None else "fields")[0] and belief.sound_motion(q, pose, "grasping"):
            if found is not None or belief.sound(q[None], "fields")[0]:
                return q
            found = q
    return found


def _error(belief: PeerBelief, whole: Array, place: Array, within: float) -> tuple[Array, Array]:
    """The vector from the marker to the sphere of that radius around the place, (K, 3) m, and its length, (K,)."""
    error = place - belief.model.evaluate(whole).position(belief.marker)
    distance = np.linalg.norm(error, axis=1)
    missing = np.maximum(distance - within, 0.0)
    return error * (missing / np.maximum(distance, 1e-12))[:, None], missing


SHORTCUTS = 60  # tried


class _Believed:
    """A Judge by what a peer believes, within the limits that exert no force."""

    def __init__(self, belief: PeerBelief, care: Care) -> None:
        self.low, self.span, self.box = belief.range[:, 0], belief.span, belief.limits
        self._belief, self._care = belief, care

    def sound(self, q: Array) -> NDArray[np.bool_]:
        """See Judge."""
        return self._belief.sound(q, self._care)

    def sound_motion(self, start: Array, end: Array) -> bool:
        """See Judge."""
        return self._belief.sound_motion(start, end, self._care)


def rrt_connect(
    belief: PeerBelief, start: Array, ends: Array, seed: int, care: Care = "solids", extensions: int = EXTENSIONS
) -> Array | None:
    """A sound path from a sound pose (d,) to one of the poses (G, d), as its corners (k, d) rad; None: none was found.

    Raises OmplMissing.
    """
    return connected(_Believed(belief, care), start, ends, seed, extensions)


def shortened(belief: PeerBelief, path: Array, rng: np.random.Generator, care: Care = "solids") -> Array:
    """The path (k, d) with corners cut where that is sound: between points drawn on it, then from each corner as far as it goes."""
    found = _straightened(belief, list(path), care)
    for _ in range(SHORTCUTS if len(found) > 2 else 0):
        first, second = np.sort(rng.uniform(0.0, len(found) - 1, 2))
        i, j = int(first), int(second)
        if i == j:
            continue
        one, other = (found[k] + (place - k) * (found[k + 1] - found[k]) for k, place in ((i, first), (j, second)))
        if belief.sound_motion(one, other, care):
            found = [*found[: i + 1], one, other, *found[j + 1 :]]
    return np.array(_straightened(belief, found, care))


def _straightened(belief: PeerBelief, path: list[Array], care: Care) -> list[Array]:
    """Of the corners only those that are needed, greedily from the start."""
    corners, at = [path[0]], 0
    while at < len(path) - 1:
        at = next(k for k in range(len(path) - 1, at, -1) if k == at + 1 or belief.sound_motion(path[at], path[k], care))
        corners.append(path[at])
    return corners
