"""The roadmaps that are compared: OMPL's, and the lattice of the MDP taken as one."""

from __future__ import annotations

import numpy as np

from experiments.prm_vs_mdp.belief import Belief
from experiments.prm_vs_mdp.ompl_roadmap import ompl_roadmap
from experiments.prm_vs_mdp.roadmap import Roadmap, edge
from mobee import Lattice
from mobee.robot.robot import Ints

MILESTONES, NEIGHBOURS = 300, 10  # of OMPL's roadmap; the second is its default
KINDS = ("OMPL", "lattice")


def make_roadmap(kind: str, belief: Belief, lattice: Lattice, seed: int) -> Roadmap:
    """A roadmap of one of the KINDS, every motion of which is believed to be sound."""
    if kind == "OMPL":
        return ompl_roadmap(belief, MILESTONES, NEIGHBOURS, seed)
    samples = np.flatnonzero(belief.sound(lattice.samples))
    vertex = {int(state): number for number, state in enumerate(samples)}
    wanted = {edge(vertex[s], vertex[int(g)]) for s in vertex for g in lattice.actions(s) if int(g) in vertex}
    poses = lattice.samples[samples]
    return Roadmap(poses, [(v, w) for v, w in sorted(wanted) if belief.is_sound_motion(poses[v], poses[w])], belief)


def with_goals(roadmap: Roadmap, lattice: Lattice, goals: Ints) -> dict[int, int]:
    """Add the samples of goal states that are no vertices yet; returns the vertex of each state."""
    found = {}
    for state in sorted({int(goal) for goal in goals}):
        sample = lattice.samples[state]
        here = roadmap.nearest(sample, 1)[0]
        found[state] = here if np.array_equal(roadmap.vertices[here], sample) else roadmap.add(sample, NEIGHBOURS)
    return found
