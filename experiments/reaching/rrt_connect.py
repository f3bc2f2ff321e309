"""OMPL's RRT-Connect on what a peer believes, and shortcuts of what it finds (Kuffner and LaValle 2000; Geraerts and Overmars 2007)."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.prm_vs_mdp.ompl_roadmap import require_ompl
from experiments.reaching.peer_belief import Care, PeerBelief
from mobee.robot.robot import Array

EXTENSIONS = 3000  # of the trees, after which the search is given up
RANGE = 0.25  # of the motors' ranges, the longest extension
SHORTCUTS = 60  # tried


def rrt_connect(
    belief: PeerBelief, start: Array, ends: Array, seed: int, care: Care = "solids", extensions: int = EXTENSIONS
) -> Array | None:
    """A sound way from a sound pose (d,) to one of the poses (G, d), as its corners (k, d) rad; None: none was found.

    Raises OmplMissing.
    """
    base, geometric, util = require_ompl()
    util.setLogLevel(util.LOG_NONE)  # that the seed is set once more; what is made from here on follows it
    util.RNG.setSeed(seed % (2**31 - 1) + 1)
    low = belief.range[:, 0]
    within = np.concatenate([belief.limits.T, start[None], ends])  # where no limit pushes, unless it begins or ends there
    space = base.RealVectorStateSpace(len(low))
    bounds = base.RealVectorBounds(len(low))
    for joint in range(len(low)):
        bounds.setLow(joint, float(((within[:, joint] - low[joint]) / belief.span[joint]).min()))
        bounds.setHigh(joint, float(((within[:, joint] - low[joint]) / belief.span[joint]).max()))
    space.setBounds(bounds)

    def pose(state: Any) -> Array:
        found: Array = low + belief.span * np.array([state[i] for i in range(len(low))])
        return found

    class Motions(base.MotionValidator):  # a whole motion is one batch
        def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802
            return belief.sound_motion(pose(first), pose(second), care)

    information = base.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: bool(belief.sound(pose(state)[None], care)[0]))
    motions = Motions(information)
    information.setMotionValidator(motions)
    information.setup()
    problem = base.ProblemDefinition(information)
    problem.addStartState(_state(space, (start - low) / belief.span))
    wanted = base.GoalStates(information)
    for end in ends:
        wanted.addState(_state(space, (end - low) / belief.span))
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
    return np.array([pose(path.getState(i)) for i in range(path.getStateCount())])


def shortened(belief: PeerBelief, path: Array, rng: np.random.Generator, care: Care = "solids") -> Array:
    """The way (k, d) with corners cut where that is sound: between points drawn on it, then from each corner as far as it goes."""
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


def _state(space: Any, values: Array) -> Any:
    state = space.allocState()
    for i, value in enumerate(values):
        state[i] = float(value)
    return state
