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

from mobee.robot.robot import Ints, LinkPair, Shape


@dataclass(frozen=True, slots=True)
class Element:
    """A <link> or <joint>: what carries it (-1: none), its tag, part, noSelfCollision subtree (-1: none) and link of the robot."""

    parent: int
    tag: str
    part: str
    subtree: int
    link: int = 0


def published_pairs(elements: Sequence[Element], hosts: Sequence[int], shapes: Sequence[Shape], role: str) -> Ints:
    """Pairs of shapes of one role that are tested, shape (p, 2), indices into `shapes`; `hosts`: the element of each shape."""
    chosen = [index for index, shape in enumerate(shapes) if shape.role == role]
    near = neighbours(elements, {hosts[index] for index in chosen})
    pairs = [(i, j) for i, j in combinations(chosen, 2) if not _reason(elements, hosts[i], hosts[j], role, near)]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def published_untested(elements: Sequence[Element], hosts: Sequence[int], shapes: Sequence[Shape]) -> dict[LinkPair, str]:
    """Pairs of links that are never tested, and why: the rule for solids holds for every element of the one and of the other.

    The elements of a link are those that bear a solid or, if there is none, all of them.
    """
    solid = {host for host, shape in zip(hosts, shapes, strict=True) if shape.role == "solid"}
    near = neighbours(elements, solid)
    of_link: dict[int, list[int]] = {}
    for index, element in enumerate(elements):
        of_link.setdefault(element.link, []).append(index)
    for link, mine in of_link.items():
        of_link[link] = [index for index in mine if index in solid] or mine
    untested = {}
    for (a, first), (b, second) in combinations(of_link.items(), 2):
        reasons = [_reason(elements, i, j, "solid", near) for i in first for j in second]
        if all(reasons):
            untested[frozenset((a, b))] = reasons[0]
    return untested


def _reason(elements: Sequence[Element], i: int, j: int, role: str, near: Collection[frozenset[int]]) -> str:
    """Why shapes of two elements are not tested against each other; empty if they are."""
    a, b = elements[i], elements[j]
    if i == j:
        return "same element"
    if a.subtree == b.subtree != -1:
        return "same hand (noSelfCollision)"
    related = a.part == b.part or a.parent == b.parent or a.parent == j or b.parent == i
    if frozenset((i, j)) in near and (role == "field" or related):
        return "neighbours (rule of 2014)"
    return ""


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
