"""OMPL's PRM, if it is there: samples, verified by what is believed, and the edges between them."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.prm_vs_mdp.belief import STEP, Belief
from experiments.prm_vs_mdp.roadmap import Roadmap
from mobee.errors import MobeeError
from mobee.robot.robot import Array


class OmplMissing(MobeeError):
    """Raised when a roadmap of OMPL is asked for and OMPL is not installed."""


def require_ompl() -> tuple[Any, Any, Any]:
    """OMPL's modules base, geometric and util; raises OmplMissing."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        raise OmplMissing("this experiment needs OMPL, which is not installed: pip install '.[planning]' in MoBeE's folder") from None
    return base, geometric, util


def ompl_roadmap(belief: Belief, milestones: int, neighbours: int, seed: int) -> Roadmap:
    """Grow a PRM over the arm's four joints, in fractions of their ranges; raises OmplMissing."""
    base, geometric, util = require_ompl()
    util.setLogLevel(util.LOG_ERROR)
    rng = np.random.default_rng([seed, 300])
    space = base.RealVectorStateSpace(len(belief.span))
    bounds = base.RealVectorBounds(len(belief.span))
    origin, high = belief.limits[:, 0], np.ptp(belief.limits, axis=1) / belief.span
    for joint in range(len(high)):
        bounds.setLow(joint, 0.0)
        bounds.setHigh(joint, float(high[joint]))
    space.setBounds(bounds)

    def pose(state: Any) -> Array:
        found: Array = origin + belief.span * np.array([state[joint] for joint in range(len(origin))])
        return found

    class Sampler(base.ValidStateSampler):  # OMPL's own draws what no seed decides but the first of a process
        def sample(self, state: Any) -> bool:
            for joint, drawn in enumerate(rng.uniform(size=len(origin)) * high):
                state[joint] = float(drawn)
            return bool(belief.sound(pose(state)[None])[0])

    information = base.SpaceInformation(space)
    information.setValidStateSamplerAllocator(Sampler)
    information.setStateValidityChecker(lambda state: bool(belief.sound(pose(state)[None])[0]))
    information.setStateValidityCheckingResolution(STEP / space.getMaximumExtent())
    information.setup()
    planner = geometric.PRM(information)
    planner.setMaxNearestNeighbors(neighbours)
    planner.setProblemDefinition(base.ProblemDefinition(information))
    planner.setup()
    planner.growRoadmapPtc(base.PlannerTerminationCondition(lambda: planner.milestoneCount() >= milestones))
    data = base.PlannerData(information)
    planner.getPlannerData(data)
    vertices = np.array([pose(data.getVertex(v).getState()) for v in range(data.numVertices())])
    edges = [(v, w) for v in range(len(vertices)) for w in data.getEdges(v) if v < w]
    return Roadmap(vertices, edges, belief)
