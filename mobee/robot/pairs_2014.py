"""Which shapes are tested against each other in the model that was published in 2014 (adjacency="published_2014" in a robot file).

The rule works on the elements <link> and <joint> of the file. Below every element, and below those beside it, the tree is descended
until one link and one joint that bear a shape of the role in question have been passed. What is met on the way is a neighbour: its
fields are not tested against the element's; its solids are not if both are of one part, or one carries the other, or both hang on
the same element. Read so, no field of icub_2014 touches another at home.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from mobee.robot.pairs import LinkPair
from mobee.robot.robot import Ints, Shape


@dataclass(frozen=True, slots=True)
class Element:
    """A <link> or <joint>: the element that carries it (-1: none), its tag, its part, its noSelfCollision subtree (-1: none)."""

    parent: int
    tag: str
    part: str
    subtree: int


def published_pairs(
    elements: Sequence[Element], hosts: Sequence[int], shapes: Sequence[Shape], role: str, ignored: Collection[LinkPair]
) -> Ints:
    """Pairs of shapes of one role that are tested, shape (p, 2), indices into `shapes`; `hosts`: the element of each shape."""
    chosen = [index for index, shape in enumerate(shapes) if shape.role == role]
    near = neighbours(elements, {hosts[index] for index in chosen})
    pairs = []
    for i, j in combinations(chosen, 2):
        a, b = elements[hosts[i]], elements[hosts[j]]
        same_hand = a.subtree == b.subtree != -1
        adjacent = frozenset((hosts[i], hosts[j])) in near
        if role == "solid":
            related = a.parent == b.parent or a.parent == hosts[j] or b.parent == hosts[i]
            adjacent = adjacent and (a.part == b.part or related)
        left_out = frozenset((shapes[i].link, shapes[j].link)) in ignored
        if hosts[i] != hosts[j] and not same_hand and not adjacent and not left_out:
            pairs.append((i, j))
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def neighbours(elements: Sequence[Element], bearing: set[int]) -> set[frozenset[int]]:
    """Pairs of elements that meet on a descent; `bearing`: the elements that bear a shape."""
    children: dict[int, list[int]] = {}
    for index, element in enumerate(elements):
        children.setdefault(element.parent, []).append(index)
    pairs: set[frozenset[int]] = set()

    def descend(start: int, below: int, passed: frozenset[str]) -> None:
        for child in children.get(below, ()):
            pairs.add(frozenset((start, child)))
            seen = passed | {elements[child].tag} if child in bearing else passed
            if len(seen) < 2:
                descend(start, child, seen)

    for index, element in enumerate(elements):
        descend(index, index, frozenset())
        for beside in children[element.parent]:
            if beside != index:
                pairs.add(frozenset((index, beside)))
                descend(index, beside, frozenset({elements[beside].tag} if beside in bearing else ()))
    return pairs
