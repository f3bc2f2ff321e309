"""Which shapes of a robot are tested against each other.

Solids and fields follow one rule; a pair is left out when
- both shapes are on the same link, or their links are joined (below);
- both are inside one subtree marked noSelfCollision (a hand: its fingers touch each other and the palm by design);
- the file says so: <ignore first="link" second="link"/>;
- they are fields of the same part: an arm's own fields overlap wherever the arm bends, and its joint limits keep its solids apart.

Joined: a cluster is a group of joints, each within 5 cm of the one that carries it or of one beside it (shoulder, elbow and
pro-supination, wrist, neck, torso), for a shape there fills the whole cluster. The link that carries a cluster and all links that
its joints move are joined pairwise: chest with the whole shoulder and upper arm, upper arm with elbow and forearm, forearm with
wrist and hand.
So hands and forearms are tested against torso, head and the other arm, and only what overlaps in every pose is left out.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations

import numpy as np

from mobee.robot.robot import Ints, Joint, Shape

CLUSTER = 0.05  # m between the points of joints that count as one place

LinkPair = frozenset[int]


def joined_links(joints: Sequence[Joint]) -> set[LinkPair]:
    """Pairs of links that meet in one cluster of joints."""
    cluster: dict[int, int] = {}  # joint -> first joint of its cluster
    members: dict[int, set[int]] = {}
    for index, joint in enumerate(joints):
        before = [k for k in range(index) if k == joint.parent - 1 or joints[k].parent == joint.parent]
        near = (k for k in before if float(np.linalg.norm(joint.point - joints[k].point)) < CLUSTER)
        first = next(near, None)
        cluster[index] = index if first is None else cluster[first]
        members.setdefault(cluster[index], {joint.parent}).add(index + 1)
    return {frozenset(pair) for links in members.values() for pair in combinations(sorted(links), 2)}


def tested_pairs(
    shapes: Sequence[Shape],
    role: str,
    joined: Collection[LinkPair],
    subtree: Sequence[int],
    ignored: Collection[LinkPair],
) -> Ints:
    """Pairs of shapes of one role that are tested, shape (p, 2), indices into `shapes`.

    `subtree`: for each link the noSelfCollision subtree that it is in, -1 for none.
    """
    chosen = [index for index, shape in enumerate(shapes) if shape.role == role]
    pairs = []
    for i, j in combinations(chosen, 2):
        a, b = shapes[i].link, shapes[j].link
        links = frozenset((a, b))
        same_hand = subtree[a] == subtree[b] != -1
        same_part = role == "field" and shapes[i].part == shapes[j].part
        if a != b and links not in joined and links not in ignored and not same_hand and not same_part:
            pairs.append((i, j))
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)
