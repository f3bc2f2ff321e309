# SPDX-License-Identifier: Apache-2.0
"""The planners RRT-Connect, PRM and PRM* of OMPL for a robot in its world; they need the extra `planning` of the package."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array, Ints, checked_count, real_array
from mobee.errors import InvalidValue, MobeeError
from mobee.model.model import Model
from mobee.roadmap.ik.problem import chosen, solid_model

EXTENSIONS = 3000  # number of extensions of the trees after which a search is given up
RANGE = 0.25  # of the ranges, the longest extension
INVALID = 10_000  # number of invalid samples, one after the other, after which a roadmap is given up


class OmplMissing(MobeeError):
    """Raised when a planner of OMPL is called and OMPL is not installed."""


def require_ompl() -> tuple[Any, Any, Any]:
    """Return OMPL's modules base, geometric and util; raise OmplMissing if OMPL is not installed."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise OmplMissing('this needs OMPL, which is not installed: pip install "mobee[planning]"') from None
    return base, geometric, util


class ValidityChecker(Protocol):
    """The interface of a checker that decides which poses (d,) rad of d joints, and which straight motions between them, are valid."""

    @property
    def low(self) -> Array:
        """Lower limits of the joints (d,) rad; OMPL gets poses as (q - low) / span."""

    @property
    def span(self) -> Array:
        """Ranges of the joints (d,) rad; OMPL gets poses as (q - low) / span."""

    @property
    def box(self) -> Array:
        """Limits (d, 2) rad between which OMPL draws its samples."""

    def sound(self, q: Array) -> NDArray[np.bool_]:
        """Return whether each of the poses q (P, d) rad is valid, (P,)."""

    def sound_motion(self, start: Array, end: Array) -> bool:
        """Return whether the straight motion from pose `start` (d,) rad to pose `end` (d,) rad is valid."""


class Free:
    """A `ValidityChecker` that asks a function whether poses of all motors are valid.

    Args:
        free: takes poses (P, n) rad and returns whether each is valid, (P,).
        rest: (n,) rad, a pose of all motors, at which the motors that do not move stay.
        columns: (d,) indices of the motors that move.
        limits: (d, 2) rad, of the motors that move.
        step: largest distance between two checked poses of a motion, as a fraction of each motor's range.
    """

    def __init__(self, free: Callable[[Array], Any], rest: Array, columns: Ints, limits: Array, step: float) -> None:
        self._free, self._rest, self._step = free, rest, step
        self.columns, self.box = columns, limits
        self.low, self.span = limits[:, 0], np.ptp(limits, axis=1)

    def whole(self, q: Array) -> Array:
        """Return poses of all motors (P, n) rad from positions of the moving motors q (P, d) rad; the others are at `rest`."""
        found = np.repeat(self._rest[None], len(q), axis=0)
        found[:, self.columns] = q
        return found

    def sound(self, q: Array) -> NDArray[np.bool_]:
        """Return whether each of the poses q (P, d) rad is valid, (P,)."""
        return np.asarray(self._free(self.whole(q)), dtype=bool)

    def sound_motion(self, start: Array, end: Array) -> bool:
        """Return whether the straight motion from `start` (d,) rad to `end` (d,) rad is valid; its poses are checked as one batch."""
        count = max(1, int(np.ceil(np.abs((end - start) / self.span).max() / self._step)))
        shares = np.arange(1, count + 1)[:, None] / count
        return bool(self.sound(start + shares * (end - start)).all())


@dataclass(frozen=True, slots=True, eq=False)
class Grown:
    """A roadmap that OMPL has grown.

    `q`: the pose of each vertex. The functions `prm` and `prm_star` give poses of all motors, (V, n) rad; the function `grown` gives poses
    of the checker's joints, (V, d) rad. `edges`: (E, 2) indices of the two poses that each edge joins, the lower index first.
    """

    q: Array
    edges: Ints


def connected(checker: ValidityChecker, start: Array, ends: Array, seed: int, extensions: int = EXTENSIONS) -> Array | None:
    """Find a valid path from a valid pose to one of several poses by RRT-Connect.

    Returns the corners of the path, (k, d) rad, or None if no path was found, or if the start or all goals are not valid. Raises
    OmplMissing if OMPL is not installed.

    Args:
        checker: decides which poses and motions are valid.
        start: (d,) rad; may lie outside the limits `checker.box`.
        ends: (G, d) rad, the goal poses; may lie outside these limits.
        seed: of all random numbers.
        extensions: number of extensions of the trees after which the search ends without a path.
    """
    base, geometric, util = require_ompl()
    sound = checker.sound(np.concatenate([start[None], ends]))
    if not sound[0] or not sound[1:].any():
        return None  # OMPL would wait until the end of the search for a goal that is valid
    util.setLogLevel(util.LOG_NONE)  # a warning that the seed is set again; objects made from here on use it
    util.RNG.setSeed(seed % (2**31 - 1) + 1)
    low, span = checker.low, checker.span
    within = (np.concatenate([checker.box.T, start[None], ends]) - low) / span
    space = _space(base, within.min(axis=0), within.max(axis=0))
    information = _information(base, space, checker)
    motions = _motions(base, information, checker)
    information.setMotionValidator(motions)
    information.setup()
    problem = base.ProblemDefinition(information)
    problem.addStartState(_state(space, (start - low) / span))
    wanted = base.GoalStates(information)
    for end in ends:
        wanted.addState(_state(space, (end - low) / span))
    problem.setGoal(wanted)
    planner = geometric.RRTConnect(information)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    asked = 0

    def enough() -> bool:
        nonlocal asked
        asked += 1
        return asked > extensions

    planner.solve(base.PlannerTerminationCondition(enough))
    if not problem.hasExactSolution():
        return None
    path = problem.getSolutionPath()
    return np.array([_pose(checker, path.getState(i)) for i in range(path.getStateCount())])


def grown(
    kind: str, checker: ValidityChecker, milestones: int, neighbours: int | None, seed: int, resolution: float | None = None
) -> Grown:
    """Grow a probabilistic roadmap until it has `milestones` vertices; they are drawn between the limits `checker.box`.

    Args:
        kind: OMPL's planner, "PRM" or "PRMstar".
        checker: decides which poses and motions are valid.
        milestones: number of vertices.
        neighbours: number of nearest vertices to which the planner tries to join each vertex; None: the planner's own rule.
        seed: of the samples.
        resolution: OMPL checks single poses of each motion, at most this Euclidean distance apart, with each joint position in units of the
            joint's range (`checker.span`). None: the checker checks each motion as a whole (`sound_motion`).

    Raises:
        OmplMissing: OMPL is not installed.
        MobeeError: no valid pose was found in INVALID (10 000) samples.
    """
    base, geometric, util = require_ompl()
    util.setLogLevel(util.LOG_ERROR)
    rng = np.random.default_rng([seed, 300])
    low, span = checker.low, checker.span
    corner, high = (checker.box[:, 0] - low) / span, np.ptp(checker.box, axis=1) / span
    space = _space(base, corner, corner + high)

    invalid = 0

    def sample(self: Any, state: Any) -> bool:
        nonlocal invalid
        for joint, drawn in enumerate(corner + rng.uniform(size=len(low)) * high):
            state[joint] = float(drawn)
        is_valid = bool(checker.sound(_pose(checker, state)[None])[0])
        invalid = 0 if is_valid else invalid + 1
        return is_valid

    information = _information(base, space, checker)
    # OMPL's own sampler ignores every seed except the first one of a process.
    information.setValidStateSamplerAllocator(type("Sampler", (base.ValidStateSampler,), {"sample": sample}))
    motions = _motions(base, information, checker)
    if resolution is None:
        information.setMotionValidator(motions)
    else:
        information.setStateValidityCheckingResolution(resolution / space.getMaximumExtent())
    information.setup()
    planner = getattr(geometric, kind)(information)
    if neighbours is not None:
        planner.setMaxNearestNeighbors(neighbours)
    planner.setProblemDefinition(base.ProblemDefinition(information))
    planner.setup()
    planner.growRoadmapPtc(base.PlannerTerminationCondition(lambda: planner.milestoneCount() >= milestones or invalid >= INVALID))
    if invalid >= INVALID:
        raise MobeeError(f"{INVALID} random poses, one after the other, are not valid: change the world, the fixed motors or the limits.")
    data = base.PlannerData(information)
    planner.getPlannerData(data)
    vertices = np.array([_pose(checker, data.getVertex(v).getState()) for v in range(data.numVertices())])
    edges = [(v, w) for v in range(len(vertices)) for w in data.getEdges(v) if v < w]
    return Grown(vertices, np.array(edges, dtype=np.intp).reshape(-1, 2))


def _space(base: Any, low: Array, high: Array) -> Any:
    space = base.RealVectorStateSpace(len(low))
    bounds = base.RealVectorBounds(len(low))
    for joint in range(len(low)):
        bounds.setLow(joint, float(low[joint]))
        bounds.setHigh(joint, float(high[joint]))
    space.setBounds(bounds)
    return space


def _information(base: Any, space: Any, checker: ValidityChecker) -> Any:
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: bool(checker.sound(_pose(checker, state)[None])[0]))
    return information


def _motions(base: Any, information: Any, checker: ValidityChecker) -> Any:
    """Return a motion validator that checks a motion as one batch; the caller must keep a reference to it."""

    def check(self: Any, first: Any, second: Any) -> bool:
        return checker.sound_motion(_pose(checker, first), _pose(checker, second))

    return type("Motions", (base.MotionValidator,), {"checkMotion": check})(information)


def _pose(checker: ValidityChecker, state: Any) -> Array:
    found: Array = checker.low + checker.span * np.array([state[i] for i in range(len(checker.low))])
    return found


def _state(space: Any, values: Array) -> Any:
    state = space.allocState()
    for i, value in enumerate(values):
        state[i] = float(value)
    return state


STEP = 0.02  # fraction of a motor's range, between two checked poses of a motion
MILESTONES, NEIGHBOURS = 300, 10


def rrt_connect(
    model: Model,
    start: ArrayLike,
    goals: ArrayLike,
    motors: Sequence[str] | None = None,
    seed: int = 0,
    extensions: int = EXTENSIONS,
    step: float = STEP,
) -> Array | None:
    """Find a path from a pose to one of several goal poses, by RRT-Connect (Kuffner and LaValle 2000).

    On the path the solids (volumes of the robot's body) have no contacts; fields, larger volumes that cause repulsive forces, are ignored.

    Args:
        model: robot and world.
        start: (n,) rad, all motors.
        goals: (n,) or (G, n) rad; motors that may not move keep their position at the start.
        motors: names of motors or parts that may move; None: all.
        seed: of all random numbers.
        extensions: number of extensions of the trees after which the search ends without a path.
        step: fraction of each motor's range between the checked poses of a motion.

    Returns:
        Poses (K, n) rad from the start to a goal, or None: no path was found; start and one goal at least must be without contacts.

    Raises:
        OmplMissing, InvalidValue, UnknownName: OMPL is not installed, or an argument is invalid; the message states the remedy.
    """
    free, first = _free(model, motors, start, step)
    if first.ndim != 1:
        raise InvalidValue(f"start has shape {first.shape}; it must be one pose ({len(model.robot.motors)},) rad.")
    ends = np.atleast_2d(_poses(model, goals))[:, free.columns]
    path = connected(free, first[free.columns], ends, seed, extensions)
    return None if path is None else free.whole(path)


def prm(
    model: Model,
    motors: Sequence[str] | None = None,
    milestones: int = MILESTONES,
    neighbours: int = NEIGHBOURS,
    rest: ArrayLike | None = None,
    seed: int = 0,
    step: float = STEP,
) -> Grown:
    """Grow a probabilistic roadmap (Kavraki et al. 1996). In its poses and motions the solids, volumes of the body, have no contacts.

    Fields, larger volumes that cause repulsive forces, are ignored.

    Args:
        model: robot and world.
        motors: names of motors or parts that move; None: all.
        milestones: least number of poses.
        neighbours: number of nearest poses to which the planner tries to join each pose.
        rest: (n,) rad, the positions of the motors that do not move; the values of the other motors are not used. None: the home posture.
        seed: of the samples.
        step: fraction of each motor's range between the checked poses of a motion.

    Raises:
        OmplMissing, InvalidValue, UnknownName: OMPL is not installed, or an argument is invalid; the message states the remedy.
        MobeeError: 10 000 random poses, one after the other, are not valid.
    """
    return _grown("PRM", model, motors, milestones, neighbours, rest, seed, step)


def prm_star(
    model: Model,
    motors: Sequence[str] | None = None,
    milestones: int = MILESTONES,
    rest: ArrayLike | None = None,
    seed: int = 0,
    step: float = STEP,
) -> Grown:
    """Grow a roadmap with PRM* (Karaman and Frazzoli 2011). In its poses and motions the solids, volumes of the body, have no contacts.

    Fields, larger volumes that cause repulsive forces, are ignored.

    The number of neighbours that PRM* chooses makes paths asymptotically optimal.

    Args:
        model: robot and world.
        motors: names of motors or parts that move; None: all.
        milestones: least number of poses.
        rest: (n,) rad, the positions of the motors that do not move; the values of the other motors are not used. None: the home posture.
        seed: of the samples.
        step: fraction of each motor's range between the checked poses of a motion.

    Raises:
        OmplMissing, InvalidValue, UnknownName: OMPL is not installed, or an argument is invalid; the message states the remedy.
        MobeeError: 10 000 random poses, one after the other, are not valid.
    """
    return _grown("PRMstar", model, motors, milestones, None, rest, seed, step)


def query(
    model: Model, joints: Sequence[str], rest: ArrayLike, seed: int = 0, extensions: int = EXTENSIONS
) -> Callable[[Array, Array], Array | None]:
    """Return a function that plans with `rrt_connect` for some joints of the robot, as `MapExplorer` needs it.

    The function takes a pose of the joints (d,) rad and goal poses (G, d) rad; it returns poses (K, d) rad from the start to one of the
    goals, or None. The other motors stay at their positions in `rest`, a pose (n,) rad of all motors. `seed`: of the random samples of each
    search. `extensions`: number of extensions of the trees after which the search ends.
    """
    whole = _poses(model, rest)
    columns = np.array([model.robot.motor_index(joint) for joint in joints])

    def ask(start: Array, goals: Array) -> Array | None:
        ends = np.repeat(whole[None], len(goals) + 1, axis=0)
        ends[:, columns] = np.concatenate([start[None], goals])
        path = rrt_connect(model, ends[0], ends[1:], joints, seed, extensions)
        return None if path is None else path[:, columns]

    return ask


def _grown(
    kind: str,
    model: Model,
    motors: Sequence[str] | None,
    milestones: int,
    neighbours: int | None,
    rest: ArrayLike | None,
    seed: int,
    step: float,
) -> Grown:
    milestones = checked_count("milestones", milestones, 1)
    neighbours = None if neighbours is None else checked_count("neighbours", neighbours, 1)
    free, _ = _free(model, motors, model.robot.home if rest is None else rest, step)
    found = grown(kind, free, milestones, neighbours, seed)
    return Grown(free.whole(found.q), found.edges)


def _free(model: Model, motors: Sequence[str] | None, rest: ArrayLike, step: float) -> tuple[Free, Array]:
    if not 0.0 < step <= 1.0:
        raise InvalidValue(f"step={step!r}: give a fraction of the motors' ranges above 0.")
    pose, columns = _poses(model, rest), chosen(model.robot, motors)
    limits = model.robot.limits
    columns = columns[limits[columns, 0] < limits[columns, 1]]
    solid = solid_model(model)
    return Free(lambda q: solid.evaluate(q).count == 0, pose, columns, limits[columns], step), pose


def _poses(model: Model, given: ArrayLike) -> Array:
    poses, n = real_array("the pose", given), len(model.robot.motors)
    if poses.ndim not in (1, 2) or poses.shape[-1] != n or not np.isfinite(poses).all():
        raise InvalidValue(f"a pose of shape {poses.shape}: give all {n} motors of {model.robot.name}, finite, in rad.")
    return poses
