"""OMPL's PRM: samples, verified by what is believed, and the edges between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.prm_vs_mdp.belief import STEP, Belief
from experiments.prm_vs_mdp.roadmap import Roadmap
from mobee.roadmap.ompl_base import OmplMissing, grown, require_ompl
from mobee.robot.robot import Array

__all__ = ["OmplMissing", "ompl_roadmap", "require_ompl"]


class _Believed:
    """A Judge by what is believed, within the limits that exert no force."""

    def __init__(self, belief: Belief) -> None:
        self.low, self.span, self.box = belief.limits[:, 0], belief.span, belief.limits
        self.sound_motion = belief.is_sound_motion
        self._belief = belief

    def sound(self, q: Array) -> NDArray[np.bool_]:
        """See Judge."""
        return self._belief.sound(q)


def ompl_roadmap(belief: Belief, milestones: int, neighbours: int, seed: int) -> Roadmap:
    """Grow a PRM over the arm's four joints, in fractions of their ranges; raises OmplMissing."""
    found = grown("PRM", _Believed(belief), milestones, neighbours, seed, resolution=STEP)
    return Roadmap(found.q, [(v, w) for v, w in found.edges.tolist()], belief)
