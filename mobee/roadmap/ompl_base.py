"""OMPL's planners in fractions of ranges, over anything that says which poses and motions are sound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mobee.errors import MobeeError
from mobee.robot.robot import Array, Ints

EXTENSIONS = 3000  # of the trees, after which a search is given up
RANGE = 0.25  # of the ranges, the longest extension


class OmplMissing(MobeeError):
    """Raised when a planner of OMPL is asked for and OMPL is not installed."""


def require_ompl() -> tuple[Any, Any, Any]:
    """OMPL's modules base, geometric and util; raises OmplMissing."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise OmplMissing("this needs OMPL, which is not installed: pip install '.[planning]' in MoBeE's folder") from None
    return base, geometric, util


class Judge(Protocol):
    """Which poses (d,) and motions of some joints are sound."""

    @property
    def low(self) -> Array:
        """(d,) rad: poses are told to OMPL as (q - low) / span."""

    @property
    def span(self) -> Array:
        """(d,) rad."""

    @property
    def box(self) -> Array:
        """(d, 2) rad, within which samples are drawn."""

    def sound(self, q: Array) -> NDArray[np.bool_]:
        """Which of the poses (P, d) are."""

    def sound_motion(self, start: Array, end: Array) -> bool:
        """Whether all of the straight way between two poses is."""


class Free:
    """A Judge of whole poses by a function.

    Args:
        free: which of the poses (P, n) rad are sound, (P,).
        rest: (n,) rad, where motors that do not move are.
        columns: (d,) those that move.
        limits: (d, 2) rad.
        step: of the ranges, between two poses of a motion that are looked at.
    """

    def __init__(self, free: Callable[[Array], Any], rest: Array, columns: Ints, limits: Array, step: float) -> None:
        self._free, self._rest, self._step = free, rest, step
        self.columns, self.box = columns, limits
        self.low, self.span = limits[:, 0], np.ptp(limits, axis=1)

    def whole(self, q: Array) -> Array:
        """All motors (P, n) from those that move (P, d)."""
        found = np.repeat(self._rest[None], len(q), axis=0)
        found[:, self.columns] = q
        return found

    def sound(self, q: Array) -> NDArray[np.bool_]:
        """See Judge."""
        return np.asarray(self._free(self.whole(q)), dtype=bool)

    def sound_motion(self, start: Array, end: Array) -> bool:
        """See Judge; looked at as one batch."""
        count = max(1, int(np.ceil(np.abs((end - start) / self.span).max() / self._step)))
        shares = np.arange(1, count + 1)[:, None] / count
        return bool(self.sound(start + shares * (end - start)).all())


@dataclass(frozen=True, slots=True, eq=False)
class Grown:
    """A graph: `q` (V, d) rad, or (V, n), and `edges` (E, 2), the lower vertex first."""

    q: Array
    edges: Ints


def connected(judge: Judge, start: Array, ends: Array, seed: int, extensions: int = EXTENSIONS) -> Array | None:
    """RRT-Connect: a sound way from a sound pose (d,) to one of (G, d), as its corners (k, d) rad; None: none was found.

    Where it begins and ends may lie outside the box.  Raises OmplMissing.
    """
    base, geometric, util = require_ompl()
    util.setLogLevel(util.LOG_NONE)  # that the seed is set once more; what is made from here on follows it
    util.RNG.setSeed(seed % (2**31 - 1) + 1)
    low, span = judge.low, judge.span
    within = (np.concatenate([judge.box.T, start[None], ends]) - low) / span
    space = _space(base, within.min(axis=0), within.max(axis=0))
    information = _information(base, space, judge)
    motions = _motions(base, information, judge)
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
    return np.array([_pose(judge, path.getState(i)) for i in range(path.getStateCount())])


def grown(kind: str, judge: Judge, milestones: int, neighbours: int | None, seed: int, resolution: float | None = None) -> Grown:
    """PRM or PRMstar over the box, until it has so many vertices.

    `neighbours`: the nearest ones that each is tried to be joined with; None: the planner's own rule.  `resolution`: of the ranges,
    between poses of a motion that OMPL looks at itself, one by one; None: the judge does.  Raises OmplMissing.
    """
    base, geometric, util = require_ompl()
    util.setLogLevel(util.LOG_ERROR)
    rng = np.random.default_rng([seed, 300])
    low, span = judge.low, judge.span
    corner, high = (judge.box[:, 0] - low) / span, np.ptp(judge.box, axis=1) / span
    space = _space(base, corner, corner + high)

    def sample(self: Any, state: Any) -> bool:
        for joint, drawn in enumerate(corner + rng.uniform(size=len(low)) * high):
            state[joint] = float(drawn)
        return bool(judge.sound(_pose(judge, state)[None])[0])

    information = _information(base, space, judge)
    # OMPL's own sampler draws what no seed decides but the first of a process.
    information.setValidStateSamplerAllocator(type("Sampler", (base.ValidStateSampler,), {"sample": sample}))
    motions = _motions(base, information, judge)
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
    planner.growRoadmapPtc(base.PlannerTerminationCondition(lambda: planner.milestoneCount() >= milestones))
    data = base.PlannerData(information)
    planner.getPlannerData(data)
    vertices = np.array([_pose(judge, data.getVertex(v).getState()) for v in range(data.numVertices())])
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


def _information(base: Any, space: Any, judge: Judge) -> Any:
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: bool(judge.sound(_pose(judge, state)[None])[0]))
    return information


def _motions(base: Any, information: Any, judge: Judge) -> Any:
    """Has a whole motion looked at as one batch; whoever sets it must keep it."""

    def check(self: Any, first: Any, second: Any) -> bool:
        return judge.sound_motion(_pose(judge, first), _pose(judge, second))

    return type("Motions", (base.MotionValidator,), {"checkMotion": check})(information)


def _pose(judge: Judge, state: Any) -> Array:
    found: Array = judge.low + judge.span * np.array([state[i] for i in range(len(judge.low))])
    return found


def _state(space: Any, values: Array) -> Any:
    state = space.allocState()
    for i, value in enumerate(values):
        state[i] = float(value)
    return state
