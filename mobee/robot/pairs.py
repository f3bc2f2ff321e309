# SPDX-License-Identifier: Apache-2.0
"""The pairs of shapes that are tested for contacts, in one robot or in several robots that are joined into one.

A solid is a volume of a link; a field is a larger volume around it, which causes a repulsive force. A pair of solids, or of fields, is
excluded if
- both shapes are on the same link, or their links are joined (below);
- both are inside one subtree marked noSelfCollision (a hand: its fingers touch each other and the palm by design);
- the file excludes it: <ignore first="link" second="link"/>;
- they are fields of the same part: an arm's own fields overlap wherever the arm bends, and its joint limits keep its solids apart.

Joined links: a cluster is a group of joints, each within 5 cm of its parent joint or of a joint on the same link, such as those of the
shoulder, the elbow with pro-supination, the wrist, the neck or the torso. A slide of more than 5 cm is alone in its cluster. A cluster
connects the link that carries it and all links that its joints move. The shapes of these links overlap at the cluster, since each fills the
whole cluster. So each pair of these links counts as joined: chest with the whole shoulder and upper arm, upper arm with elbow and forearm,
forearm with wrist and hand. So hands and forearms are tested against torso, head and the other arm. A chain of links shorter than 5 cm is
one cluster too, so that none of its links are tested against each other: `mobee check` warns of clusters that are long
(`mobee.check.touching.long_clusters`). If a robot file has adjacency="listed", only pairs in <ignore> tags are excluded, so that
`write_xml` can keep the pairs of any robot.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations

import numpy as np

from mobee.arrays import Ints
from mobee.robot.robot import Joint, LinkPair, Robot, Shape

CLUSTER = 0.05  # m: joints whose points are nearer than this belong together
CLUSTER_REASON = "joined at a cluster of joints"
MAX_NAMED = 4  # joints of a cluster that a reason lists


def joined_links(joints: Sequence[Joint]) -> dict[LinkPair, str]:
    """Return the pairs of links that one cluster of joints connects, and which are therefore not tested for contacts, with the reasons.

    A cluster is a group of joints that are close together: each joint after the first is less than CLUSTER (5 cm) from its parent joint, or
    from a joint on the same link, and none slides farther than that.
    """
    clusters = joint_clusters(joints)
    joined: dict[LinkPair, str] = {}
    for cluster in clusters:
        names = ", ".join(joints[k].name for k in cluster[:MAX_NAMED]) + (", ..." if len(cluster) > MAX_NAMED else "")
        reason = f"joined at {names}" if len(cluster) == 1 else f"{CLUSTER_REASON} ({names})"
        links = sorted({joints[k].parent for k in cluster} | {k + 1 for k in cluster})
        for pair in combinations(links, 2):
            joined.setdefault(frozenset(pair), reason)
    return joined


def slides_far(joint: Joint) -> bool:
    """Return whether a joint slides by more than CLUSTER (5 cm), so that the links that it connects do not stay close together."""
    return joint.kind == "prismatic" and float(np.ptp(joint.limits)) > CLUSTER


def joint_clusters(joints: Sequence[Joint]) -> list[list[int]]:
    """Return the clusters of joints, each as a list of indices of joints.

    A joint is compared with its parent joint, then with earlier joints on the same link. It joins the cluster of the first of these that is
    nearer than CLUSTER (5 cm); if there is none, it starts a new cluster. A joint that slides far (`slides_far`) is a cluster of its own.
    """
    points = np.array([joint.point for joint in joints]).reshape(-1, 3)
    beside: dict[int, list[int]] = {}  # link -> its joints
    home: list[int] = []  # joint -> its cluster
    clusters: list[list[int]] = []
    for index, joint in enumerate(joints):
        before = ([joint.parent - 1] if joint.parent else []) + beside.setdefault(joint.parent, [])
        near = [k for k in before if np.linalg.norm(points[k] - points[index]) < CLUSTER and not slides_far(joints[k])]
        if near and not slides_far(joint):
            home.append(home[near[0]])
        else:
            home.append(len(clusters))
            clusters.append([])
        clusters[home[index]].append(index)
        beside[joint.parent].append(index)
    return clusters


def hand_links(subtree: Sequence[int], names: Mapping[int, str]) -> dict[LinkPair, str]:
    """Return the pairs of links inside one noSelfCollision subtree (a hand), which are not tested for contacts, each with the reason.

    The attribute noSelfCollision of an element in a robot file applies to all links below it. `subtree`: for each link the number of its
    subtree, -1 if none. `names`: the name of each subtree, for the reason.
    """
    members: dict[int, list[int]] = {}
    for link, start in enumerate(subtree):
        if start != -1:
            members.setdefault(start, []).append(link)
    return {
        frozenset(pair): f"same hand (noSelfCollision of {names[start]})"
        for start, links in members.items()
        for pair in combinations(links, 2)
    }


def tested_pairs(shapes: Sequence[Shape], role: str, untested: Collection[LinkPair], own: bool = False) -> Ints:
    """Return the pairs of shapes of one role ("solid" or "field") that are tested for contacts, (p, 2), indices into `shapes`.

    `untested`: pairs of links that are excluded from the tests. `own`: whether fields (volumes that cause repulsive forces) of one part are
    tested against each other too; solids of one part always are.
    """
    chosen = np.array([index for index, shape in enumerate(shapes) if shape.role == role], dtype=np.intp)
    link = np.array([shapes[index].link for index in chosen], dtype=np.intp)
    tested = ~np.eye(link.max(initial=0) + 1, dtype=bool)
    for pair in untested:
        a, b = pair
        if max(a, b) < len(tested):
            tested[a, b] = tested[b, a] = False
    allowed = tested[link[:, None], link]
    if role == "field" and not own:
        parts = list({shapes[index].part: None for index in chosen})
        part = np.array([parts.index(shapes[index].part) for index in chosen], dtype=np.intp)
        allowed &= part[:, None] != part
    return chosen[np.argwhere(np.triu(allowed, 1))]


def link_pairs(shapes: Sequence[Shape], *pairs: Ints) -> set[LinkPair]:
    """Return the pairs of links to which pairs of shapes belong; `pairs`: arrays (p, 2) of indices into `shapes`."""
    link = np.array([shape.link for shape in shapes], dtype=np.intp)
    return {frozenset(pair) for some in pairs for pair in set(map(tuple, link[some].reshape(-1, 2).tolist()))}


def merged(*rules: Mapping[LinkPair, str]) -> dict[LinkPair, str]:
    """Merge several tables of untested pairs of links; return all pairs, each with the reason of the first table that has the pair."""
    return {pair: reason for rule in reversed(rules) for pair, reason in rule.items()}


def joined_pairs(bodies: Sequence[Robot], starts: Sequence[int], role: str) -> Ints:
    """Return the pairs of shapes of one role ("solid" or "field") that are tested for contacts in several joined robots, (p, 2), sorted.

    A field is a volume that causes a repulsive force. The pairs are those of each single robot, and all pairs of shapes of two different
    robots. A pair is left out if both shapes are on link 0, the base that the robots share. `bodies`: the robots, already with the link
    numbers of the joined robot. `starts`: for each robot, the index of its first shape in the joined robot.
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
    """Return the pairs of links of several joined robots that are never tested for contacts, each with the reason.

    They are the untested pairs of the single robots, except those that are tested in the joined robot: the robots share the base, so a link
    that is not tested against the base of its own robot can be tested against the shapes that another robot has there. `bodies`: the
    robots; their links have the indices of the joined robot. `shapes`: shapes of the joined robot. `pairs`: its tested pairs of solids and
    of fields, each (p, 2).
    """
    tested = link_pairs(shapes, *pairs)
    return merged(*({pair: reason for pair, reason in body.untested.items() if pair not in tested} for body in bodies))
