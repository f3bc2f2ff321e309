"""What is tested against what when several robots stand on one base."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee.robot.pairs import link_pairs, merged
from mobee.robot.robot import Ints, LinkPair, Robot, Shape


def joined_pairs(bodies: Sequence[Robot], starts: Sequence[int], role: str) -> Ints:
    """Pairs of shapes of one role, shape (p, 2), sorted: each robot's own, and all of different robots unless both stand on the base.

    `starts`: where the shapes of each robot begin.
    """
    pairs = [
        (body.solid_pairs if role == "solid" else body.field_pairs).reshape(-1, 2) + start
        for body, start in zip(bodies, starts, strict=False)
    ]
    chosen = [
        np.array([k + start for k, shape in enumerate(body.shapes) if shape.role == role], dtype=np.intp)
        for body, start in zip(bodies, starts, strict=False)
    ]
    link = np.array([shape.link for body in bodies for shape in body.shapes], dtype=np.intp)
    for index, mine in enumerate(chosen):
        theirs = np.concatenate([np.empty(0, dtype=np.intp), *chosen[index + 1 :]])
        both = np.array(np.meshgrid(mine, theirs, indexing="ij"), dtype=np.intp).reshape(2, -1).T
        pairs.append(both[link[both].any(axis=1)])
    found = np.concatenate(pairs)
    return found[np.lexsort(found.T[::-1])]


def joined_untested(bodies: Sequence[Robot], shapes: Sequence[Shape], pairs: Sequence[Ints]) -> dict[LinkPair, str]:
    """Each robot's own reasons, but for its base, which has become everybody's, where that is tested now."""
    tested = link_pairs(shapes, *pairs)
    return merged(*({pair: reason for pair, reason in body.untested.items() if pair not in tested} for body in bodies))
