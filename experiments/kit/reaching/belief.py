# SPDX-License-Identifier: Apache-2.0
"""The model of robot and world of `PlannerPeer`: which poses and motions are allowed (sound), inverse kinematics, and RRT-Connect.

Inverse kinematics: damped least squares from many start poses, all at the same time (Wampler 1986); in contrast,
`kit.reaching.targets.nearest_pose` returns the one pose that is nearest to a place.  Paths: OMPL's RRT-Connect (Kuffner and LaValle 2000),
and shortcuts of its paths (Geraerts and Overmars 2007).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mobee import Gains, Model, sphere
from mobee.arrays import Array, Ints
from mobee.model.pose import Pose
from mobee.reach import TARGET, ReachTarget
from mobee.roadmap.ompl import EXTENSIONS, connected
from mobee.robot.robot import Clause

STEP = 0.02  # of a motor's range, between two poses of a motion that are checked
NEAR = 0.08  # of the motors' ranges: distance from a blocked pose within which poses count as blocked
Care = Literal["grasping", "solids", "fields"]
"""Names of sets of contacts that are forbidden in a pose.

"solids": all contacts of solids.  "grasping": all contacts of solids, except those of the hand with the target.  "fields": all contacts of
solids and of fields (larger volumes that cause repulsive forces), except those of the hand's fields with the target.
"""


class PeerBelief:
    """A planner's model of robot and world.

    A pose is sound if it is within the limits of the motors and away from the poses in `blocked` (those to be avoided), violates no clause
    that the planner knows, and has no forbidden contact.  A clause is a condition on several motor positions, which the shoulder's cables
    impose.

    Args:
        model: the robot in the world, as the planner believes it to be; other code must not edit it.
        motors: names of the d motors with which motions are planned; all others stay at home.
        marker: name of the marker (a named point on a link, such as the palm) that is brought to the target.
        clauses: the clauses that the planner knows.
        gains: gains of the control law under which motions are executed.
        turns: (d,) rad, error of the encoders as the planner believes it: believed minus measured angles of the motors; None: 0.
    """

    def __init__(
        self, model: Model, motors: Sequence[str], marker: str, clauses: Sequence[Clause], gains: Gains, turns: Array | None = None
    ) -> None:
        self.model, self.marker = model, marker
        robot = model.robot
        self.columns = np.array([robot.motor_index(name) for name in motors])
        width = np.array([gains.of_motors("limit_width", robot.motors)[i] for i in self.columns])
        self.limits: Array = robot.limits[self.columns] + width[:, None] * np.array([1.0, -1.0])
        """(d, 2) rad, lowest and highest angles between which the joint limits exert no force."""
        self.range: Array = robot.limits[self.columns]
        """(d, 2) rad, limits of the motors."""
        self.span: Array = np.ptp(robot.limits[self.columns], axis=1)
        """(d,) rad, widths of the motors' ranges."""
        self.turns = np.zeros(len(motors)) if turns is None else turns
        self.blocked: Array = np.zeros((0, len(motors)))
        """(B, d) rad, poses to avoid: poses near them are not sound."""
        self.checked = 0
        """Number of poses that were checked so far."""
        self._clauses = tuple(clauses)
        self._exempt = self._hand()

    def present(self, target: ReachTarget) -> None:
        """Put the target into the believed world, in place of the earlier target, if there is one."""
        world = self.model.world
        if TARGET in world.objects:
            world.remove(TARGET)
        world.add(TARGET, sphere(target.radius), position=target.position, role="target")

    def whole(self, q: Array) -> Array:
        """Return the poses (..., n) rad in which the planner believes the robot to be for encoder readings q (..., d) rad.

        The readings are those of the d motors with which motions are planned.  The believed angle of such a motor is its reading plus the
        error in `turns`; all other motors are at home.
        """
        home = self.model.robot.home
        poses = np.empty((*q.shape[:-1], len(home)))
        poses[...] = home
        poses[..., self.columns] = q + self.turns
        return poses

    def sound(self, q: Array, care: Care = "solids") -> NDArray[np.bool_]:
        """Return which of the poses q (P, d) rad, encoder readings of the planned motors, are sound, (P,).

        A sound pose is within the limits of the motors, away from the poses in `blocked`, fulfils every clause (a condition on several
        motor positions, as the shoulder's cables impose), and has no forbidden contact.  `care`: the contacts that are forbidden; "solids":
        all contacts of solids; "grasping": these, except contacts of the hand with the target; "fields": contacts of solids and of
        repulsive fields, except those of the hand's fields with the target.  The counter `checked` is increased by P.
        """
        self.checked += len(q)
        poses = self.whole(q)
        good = self._allowed(q, poses)
        good[self._touching(poses, care)] = False
        return good

    def sound_motion(self, start: Array, end: Array, care: Care = "solids") -> bool:
        """Return whether all poses on the straight path from `start` to `end` (d,) rad are sound; the start pose is not checked.

        "Sound" and the values of `care`, the set of forbidden contacts, are explained at `PeerBelief.sound`.  The counter `checked` is
        increased by the number of checked poses.
        """
        count = max(1, int(np.ceil(np.abs((end - start) / self.span).max() / STEP)))
        shares = np.arange(1, count + 1)[:, None] / count
        q = start + shares * (end - start)
        self.checked += count
        poses = self.whole(q)
        return bool(self._allowed(q, poses).all()) and not len(self._touching(poses, care))

    def _allowed(self, q: Array, poses: Array) -> NDArray[np.bool_]:
        """Return which of P poses, (P,), are within the limits, violate no clause and are away from the poses in `blocked`.

        A clause is a condition on several motor positions.  `q`: (P, d) rad, encoder readings of the planned motors.  `poses`: (P, n) rad,
        the same poses as `whole` returns them.  Contacts are not checked.
        """
        good: NDArray[np.bool_] = np.all((q >= self.range[:, 0] - 1e-9) & (q <= self.range[:, 1] + 1e-9), axis=1)
        for clause in self._clauses:
            np.logical_and(good, (poses @ clause.a.T + clause.b).max(axis=1) >= 0.0, out=good)
        if len(self.blocked):
            away = (q[:, None] - self.blocked) / self.span
            good &= (np.sqrt((away * away).sum(axis=2)) > NEAR).all(axis=1)
        return good

    def _touching(self, poses: Array, care: Care) -> Ints:
        """Return the indices of the poses (P, n) rad that have a contact which `care` forbids; an index is repeated for each such contact.

        "solids": all contacts of solids.  "grasping": these, except contacts of the hand with the target.  "fields": contacts of solids and
        of fields, except those of the hand's fields with the target.
        """
        table = self._evaluate(poses, reaching=care == "grasping").table
        counted = table.kind == 0
        if care == "fields":  # the hand's may be in the target
            target = len(table.shapes) + table.objects.index(TARGET) if TARGET in table.objects else -1
            counted |= (table.second != target) | ~self._exempt[table.first_link]
        touching: Ints = table.pose[counted]
        return touching

    def push(self, q: Array) -> Array:
        """Return how strongly the fields push the planned motors in each pose: (P,) m^2/rad.

        `q`: (P, d) rad, encoder readings of the planned motors, one row for each pose.  Fields are volumes around robot parts and objects
        that cause repulsive forces.  The result is the norm of the sum of J^T (depth * normal) over the contacts of fields; the target does
        not push the hand.
        """
        size: Array = np.linalg.norm(self._evaluate(self.whole(q), reaching=True).projection[:, self.columns], axis=1)
        return size

    def _hand(self) -> NDArray[np.bool_]:
        """Return a mask (L,) of the robot's links: True for the links of the hand, on whose fields the target exerts no force in a reach.

        Fields are volumes around links that cause repulsive forces; some links nearer to the base than the marker also count
        (`Hand.fields`).
        """
        first = self.model.hand(self.marker).fields
        exempt = np.zeros(len(self.model.robot.links), dtype=np.bool_)
        for link in range(first, len(exempt)):  # a parent has a smaller number than its children
            exempt[link] = link == first or exempt[self.model.robot.joints[link - 1].parent]
        return exempt

    def _evaluate(self, poses: Array, reaching: bool) -> Pose:
        """Return the evaluated poses (P, n) rad: their kinematics and their contacts.

        `reaching`: True: the target exerts no force on the hand, and its contacts with the hand are not listed; False: they are listed.
        """
        return self.model.evaluate(poses, reaching=self.marker if reaching else None)


RESTARTS, STEPS = 64, 40  # of inverse kinematics
ENOUGH = 0.5  # share of starts that have arrived after which the search ends
DAMPING = 0.03  # m/rad
MAX_STEP = 0.25  # rad of each motor per step
ARRIVED, ALMOST = 2e-3, 0.01  # m, accepted error, and accepted error if no pose is better
MAX_POSES = 12  # kept, those that fields push least
RETREAT, CLEAR = 0.02, 0.2  # m, step away from the target, and largest distance


def goals(
    belief: PeerBelief, target: ReachTarget, rng: np.random.Generator, most: int = MAX_POSES, free: bool = False
) -> tuple[Array, Array]:
    """Return sound poses with the marker of `belief` on the target, and for each a pose away from the target, (K, d) rad each.

    K may be 0.  `PeerBelief` defines "sound".  From the pose away from the target the hand moves straight to the target.  The poses are
    sorted by the forces of the fields (volumes that repel), the smallest first.  `rng`: for the random starts of the search.  `most`:
    largest number of poses.  `free`: True: return only poses in which no joint limit exerts a force; False: if none of these is found,
    return poses in which joint limits exert forces.
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
    """Move the marker of `belief` from poses `starts` (K, d) rad towards a place (3,) m, by damped least squares, all at the same time.

    `within`: distance [m] from the place at which the marker has arrived.  `limits`: (d, 2) rad, of the motors.  `steps`: largest number of
    steps.  Returns the poses (K, d) rad and their remaining errors (K,) m.
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
        step *= np.minimum(1.0, MAX_STEP / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
        q = np.clip(q + step, low, high)
    return q, _error(belief, belief.whole(q), place, within)[1]


def retreat(belief: PeerBelief, pose: Array, place: Array) -> Array | None:
    """Move the marker of `belief` away from the target in steps; return the first pose (d,) rad without contacts, or None if there is none.

    The marker moves straight, in the direction from the target's centre to its position in `pose`, by up to 0.2 m.  `pose`: (d,) rad, with
    the marker on the target.  `place`: (3,) m, root frame, centre of the target.  In the returned pose no solids and no repulsive fields
    have contact; only the hand's fields may overlap the target.  If no such pose is found, the first pose without contacts of solids is
    returned.
    """
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
    """Return the vectors from the marker to a sphere of radius `within` around the place, (K, 3) m, and their lengths, (K,) m."""
    error = place - belief.model.evaluate(whole).position(belief.marker)
    distance = np.linalg.norm(error, axis=1)
    missing = np.maximum(distance - within, 0.0)
    return error * (missing / np.maximum(distance, 1e-12))[:, None], missing


SHORTCUTS = 60  # attempts


class _Careful(NamedTuple):
    """A `PeerBelief` with a fixed `care` (set of forbidden contacts), in the interface `mobee.roadmap.ompl.ValidityChecker`.

    `low`, `span`: lower limits and ranges of the d motors, (d,) rad.  `box`: (d, 2) rad, limits between which OMPL draws samples: there the
    joint limits exert no force.
    """

    low: Array
    span: Array
    box: Array
    sound: Callable[[Array], NDArray[np.bool_]]
    sound_motion: Callable[[Array, Array], bool]


def rrt_connect(
    belief: PeerBelief, start: Array, ends: Array, seed: int, care: Care = "solids", extensions: int = EXTENSIONS
) -> Array | None:
    """Return the waypoints (k, d) rad of a sound path from a sound pose to one of several poses; None if no path was found.

    `PeerBelief` defines "sound".  `start`: (d,) rad, the first pose.  `ends`: (G, d) rad, the poses of which one is to be reached.  `seed`:
    seed of the random search.  `care`: the contacts that are forbidden: "solids", "grasping" or "fields", explained at `PeerBelief.sound`.
    `extensions`: largest number of extensions of the trees. Raises OmplMissing.
    """
    sound, sound_motion = partial(belief.sound, care=care), partial(belief.sound_motion, care=care)
    checker = _Careful(belief.range[:, 0], belief.span, belief.limits, sound, sound_motion)
    return connected(checker, start, ends, seed, extensions)


def shortened(belief: PeerBelief, path: Array, rng: np.random.Generator, care: Care = "solids") -> Array:
    """Return the path (k, d) rad with straight motions in place of detours, where all poses on them are sound (allowed).

    `PeerBelief` defines "sound".  Straight motions are tried from each waypoint as far as possible, then between random points on the path,
    then from each waypoint again.  `rng`: for the random points.  `care`: the contacts that are forbidden: "solids", "grasping" or
    "fields", explained at `PeerBelief.sound`.
    """
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
    """Return a subset of the waypoints, with the first and the last, such that straight motions between them are allowed.

    The waypoints are chosen greedily: after each one follows the farthest waypoint that a straight sound motion reaches, or the next one of
    the path.  `path`: list of poses (d,) rad.  `care`: the forbidden contacts; it and "sound" are explained at `PeerBelief.sound`.
    """
    corners, at = [path[0]], 0
    while at < len(path) - 1:
        at = next(k for k in range(len(path) - 1, at, -1) if k == at + 1 or belief.sound_motion(path[at], path[k], care))
        corners.append(path[at])
    return corners
