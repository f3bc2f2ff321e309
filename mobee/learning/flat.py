"""Lays a state space out in the plane, for pictures."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.learning.lattice import Lattice
from mobee.learning.neighbours import lattice_digits
from mobee.learning.space import Space

GAP = 0.8  # between the blocks of a lattice, in steps of its first joints


def flat(space: Space) -> Array:
    """Where to draw each state, shape (S, 2).

    A lattice becomes a grid of grids, as in the paper's figure 7: the first joint goes right and the second up within a block, the
    third and fourth say which block, and so on.  Of other spaces the two directions are shown in which the samples differ most.
    """
    if isinstance(space, Lattice):
        return _nested([len(levels) for levels in space.levels])
    centred = (space.samples - space.samples.mean(axis=0)) / np.maximum(np.ptp(space.samples, axis=0), 1e-12)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    drawn = centred @ axes[:2].T
    plane: Array = np.pad(drawn, ((0, 0), (0, 2 - drawn.shape[1]))) * np.sqrt(len(space))
    return plane


def _nested(sizes: list[int]) -> Array:
    digits = lattice_digits(sizes)
    drawn, steps = np.zeros((len(digits), 2)), [1.0, 1.0]
    for joint, size in enumerate(sizes):
        axis = joint % 2
        drawn[:, axis] += steps[axis] * digits[:, joint]
        steps[axis] *= size if len(sizes) <= joint + 2 else size + GAP
    return drawn
