# SPDX-License-Identifier: Apache-2.0
"""Tested pairs by the rule of the program published in 2014, and by an earlier interpretation of that rule.

Both rules work on the elements <link> and <joint> of a file. The neighbours of an element A are the elements that a search reaches when
it descends the tree from A and from each sibling of A; the rules differ in where the search ends. Fields of neighbours are not tested
against each other. Solids of neighbours are not tested against each other if both elements are of one part, or one carries the other, or
both have the same parent.

adjacency="published_2014" is the rule of the program (kailfrank/MoBeE, KinTreeNode::ignoreAdjacentPairs). A branch of the search has two
phases. First it descends until it has passed two elements with a solid: a <link> with a <joint> as parent, and a <joint> with a <link> as
parent. Then it continues as long as the elements have the tag of A, and ends before the first element with the other tag. A, its siblings
and the elements directly below the root are exceptions: in the first phase they do not count, and in the second phase the search does not
end before them.

adjacency="recorded_2014" is an earlier interpretation, with which this project recorded its results on icub_2014. A branch of the search
continues until it has met a <link> and a <joint>, in either order, that have a solid (to find pairs of solids) or a field (to find pairs of
fields). A itself does not count. By this rule no field of icub_2014 touches another field at home; by the rule of the program the
forearm's field is 3 mm deep in the field of the thumb.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from mobee.arrays import Ints
from mobee.robot.robot import LinkPair, Shape

Rule = Literal["published_2014", "recorded_2014"]


@dataclass(frozen=True, slots=True)
class Element:
    """A <link> or <joint> element of a robot file.

    `parent`: index of the element that carries it, -1: none. `tag`: "link" or "joint". `part`: name of its part. `subtree`: index of the
    element with the attribute noSelfCollision in whose subtree it is, -1: none; shapes in one such subtree are not tested against each
    other. `link`: index of its link in the robot.
    """

    parent: int
    tag: str
    part: str
    subtree: int
    link: int = 0


def published_pairs(elements: Sequence[Element], hosts: Sequence[int], shapes: Sequence[Shape], role: str, rule: Rule) -> Ints:
    """Return the pairs of shapes of one role ("solid" or "field") that a rule of 2014 tests for contacts, (p, 2), indices in `shapes`.

    A field is a volume that causes a repulsive force. `hosts`: for each shape the index of its element. `rule`: "published_2014": the rule
    of the program published in 2014; "recorded_2014": this project's earlier interpretation of that rule.
    """
    chosen = [index for index, shape in enumerate(shapes) if shape.role == role]
    near = _near(elements, hosts, shapes, role, rule)
    pairs = [(i, j) for i, j in combinations(chosen, 2) if not _reason(elements, hosts[i], hosts[j], role, near)]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def published_untested(elements: Sequence[Element], hosts: Sequence[int], shapes: Sequence[Shape], rule: Rule) -> dict[LinkPair, str]:
    """Return the pairs of links that a rule of 2014 never tests for contacts, each with the reason.

    A pair of links is never tested if the rule for solids excludes all pairs of their elements. Of a link with solids, only the elements
    with a solid are examined; of a link without solids, all its elements. `hosts`: for each shape the index of its element. `rule`:
    "published_2014": the rule of the program published in 2014; "recorded_2014": this project's earlier interpretation of that rule.
    """
    solid = _bearing(hosts, shapes, "solid")
    near = _near(elements, hosts, shapes, "solid", rule)
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


def _near(elements: Sequence[Element], hosts: Sequence[int], shapes: Sequence[Shape], role: str, rule: Rule) -> set[frozenset[int]]:
    if rule == "published_2014":
        return neighbours(elements, _bearing(hosts, shapes, "solid"))
    return recorded_neighbours(elements, _bearing(hosts, shapes, role))


def _bearing(hosts: Sequence[int], shapes: Sequence[Shape], role: str) -> set[int]:
    """Return the elements that bear a shape of a role."""
    return {host for host, shape in zip(hosts, shapes, strict=True) if shape.role == role}


def _reason(elements: Sequence[Element], i: int, j: int, role: str, near: Collection[frozenset[int]]) -> str:
    """Return the reason why shapes of two elements are not tested against each other; empty if they are tested."""
    a, b = elements[i], elements[j]
    if i == j:
        return "same element"
    if a.subtree == b.subtree != -1:
        return "same hand (noSelfCollision)"
    related = a.part == b.part or a.parent == b.parent or a.parent == j or b.parent == i
    if frozenset((i, j)) in near and (role == "field" or related):
        return "neighbours (rule of 2014)"
    return ""


def neighbours(elements: Sequence[Element], bearing: Collection[int]) -> set[frozenset[int]]:
    """Return the pairs of neighbours in the tree by the rule "published_2014", as sets of indices of elements; element 0 is the root.

    For each element A, a search descends the tree from A and from each sibling of A. The elements that it reaches are neighbours of A (also
    A itself, as a set of one index). `bearing`: the elements that have a solid. A branch of the search has two phases:
    1. It descends until it has passed two elements of `bearing`: a <link> with a <joint> as parent, and a <joint> with a <link> as parent.
    2. Then it continues as long as the elements have the tag of A. It ends before the first element with the other tag.
    A, its siblings and the elements directly below the root are exceptions: in phase 1 they do not count, and in phase 2 the search does
    not end before them.
    """
    children: dict[int, list[int]] = {}
    for index, element in enumerate(elements):
        children.setdefault(element.parent, []).append(index)
    pairs: set[frozenset[int]] = set()
    for first, element in enumerate(elements):
        for start in children[element.parent]:
            waiting = [(first, False, False)]
            while waiting:
                here, link, joint = waiting.pop()
                found = _passed(elements, here, start, bearing, link, joint)
                if found is None:
                    continue
                pairs.add(frozenset((start, here)))
                waiting += [(child, *found) for child in children.get(here, ())]
    return pairs


def _passed(
    elements: Sequence[Element], here: int, start: int, bearing: Collection[int], link: bool, joint: bool
) -> tuple[bool, bool] | None:
    """Return the two flags of the search in `neighbours` after it has visited the element `here`; None if it ends before this element.

    The flags state whether this branch of the search has passed a link whose parent is a joint, and a joint whose parent is a link; `link`
    and `joint`: their values before the element. Only elements in `bearing`, which have a solid, count. `start`: the element whose
    neighbours are searched. The conditions are those of `neighbours`.
    """
    element, carrier = elements[here], elements[here].parent
    if carrier <= 0 or carrier == elements[start].parent:
        return link, joint
    if link and joint and element.tag != elements[start].tag:
        return None
    if here in bearing and element.tag == "link" != elements[carrier].tag:
        link = True
    elif here in bearing and element.tag != "link" == elements[carrier].tag:
        joint = True
    return link, joint


def recorded_neighbours(elements: Sequence[Element], bearing: Collection[int]) -> set[frozenset[int]]:
    """Return the pairs of neighbours in the tree by the rule "recorded_2014", as sets of two indices of elements.

    This rule is the project's earlier interpretation of the rule of the program published in 2014. For each element A, a search descends
    the tree from A and from each sibling of A. The elements that it reaches, and the siblings, are neighbours of A. `bearing`: the elements
    that have a solid (to find pairs of solids), or a field (to find pairs of fields). A branch of the search continues until it has met a
    <link> and a <joint> that are in `bearing`, in either order. A itself does not count.
    """
    children: dict[int, list[int]] = {}
    for index, element in enumerate(elements):
        children.setdefault(element.parent, []).append(index)
    pairs: set[frozenset[int]] = set()

    def descend(start: int, below: int, passed: frozenset[str]) -> None:
        waiting = [(below, passed)]
        while waiting:
            here, before = waiting.pop()
            for child in children.get(here, ()):
                pairs.add(frozenset((start, child)))
                seen = before | {elements[child].tag} if child in bearing else before
                if len(seen) < 2:
                    waiting.append((child, seen))

    for index, element in enumerate(elements):
        descend(index, index, frozenset())
        for beside in children[element.parent]:
            if beside != index:
                pairs.add(frozenset((index, beside)))
                descend(index, beside, frozenset({elements[beside].tag} if beside in bearing else ()))
    return pairs


def near_root(parents: Sequence[int], tags: Sequence[str], index: int) -> bool:
    """Return whether an element is near the root (KinTreeNode::isNearRoot): MoBeE of 2014 ignored its contacts with the world.

    Along the path from the element up to the root, the tag changes between link and joint. The element is near the root if the tag changes
    at most twice. A third change is allowed only at the last element of the path, whose parent is the root. `parents`: for each element the
    index of its parent, -1 if that is the root. `tags`: for each element "link" or "joint". `index`: index of the element.
    """
    here, link, joint = index, False, False
    while parents[here] >= 0:
        if link and joint and tags[here] != tags[index]:
            return False
        carrier = tags[parents[here]]
        link = link or tags[here] == "link" != carrier
        joint = joint or tags[here] != "link" == carrier
        here = parents[here]
    return True
