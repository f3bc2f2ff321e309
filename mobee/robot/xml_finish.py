"""From all that a robot file holds to a robot."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

from mobee.errors import InvalidValue
from mobee.robot.bodies import one_a_link
from mobee.robot.join import Placed, join_placed
from mobee.robot.pairs import hand_links, joined_links, link_pairs, merged, tested_pairs
from mobee.robot.pairs_2014 import Rule, published_pairs, published_untested
from mobee.robot.robot import Ints, Joint, LinkPair, Part, Robot
from mobee.robot.xml_body import MOST_SHAPES
from mobee.robot.xml_draft import Draft
from mobee.robot.xml_ignore import without_ignored
from mobee.robot.xml_motors import finish_joints, order_motors, read_clauses
from mobee.robot.xml_node import Node

MOST_JOINTS = 500  # pairs of links grow with the square
MOST_ELEMENTS_2014 = 500  # and the descents of pairs_2014.py faster


def finish_robot(root: Node, draft: Draft, name: str) -> Robot:
    """The robot of a draft whose file has been read to its end, joined with those of other files; raises RobotFileError."""
    if not draft.parts and not draft.others:
        root.fail("bodypart", "the robot has no body part", 'Put its motors and links inside <bodypart name="...">')
    draft.note("robot", name, root)
    draft.note("link", draft.links[0], root)
    robot = _own_robot(root, draft, name)
    if draft.others:
        robot = _with_others(robot, draft)
    return without_ignored(robot, draft.ignores)


def _own_robot(root: Node, draft: Draft, name: str) -> Robot:
    motors = order_motors(draft.motors, draft.parts)
    parts = {part: Part(part, (), 0) for part in draft.parts}
    for part in draft.parts:
        names = tuple(motor.name for motor in motors if motor.part == part)
        if not names:
            draft.parts[part][0].fail("motor", f"part {part!r} has no motor", "Add a <motor> or move its links into another part")
        parts[part] = Part(part, names, next(k for k, motor in enumerate(motors) if motor.part == part))
    joints, table = finish_joints(draft.joints, draft.drives, motors)
    names = tuple(motor.name for motor in table)
    field_pairs, solid_pairs, untested = _pairs(root, draft, joints)
    return Robot(
        name=name,
        links=tuple(draft.links),
        joints=joints,
        motor_table=table,
        parts=parts,
        markers=draft.markers,
        shapes=tuple(draft.shapes),
        clauses=tuple(read_clauses(node, parts[part], names) for part, node in draft.constraints),
        field_pairs=field_pairs,
        solid_pairs=solid_pairs,
        base_shapes=frozenset(draft.base_shapes),
        untested=untested,
        where=draft.where,
        bodies=one_a_link(draft.bodies),
    )


def _pairs(root: Node, draft: Draft, joints: tuple[Joint, ...]) -> tuple[Ints, Ints, dict[LinkPair, str]]:
    """Tested pairs of fields and of solids, and the reasons for the pairs of links that are never tested."""
    given = root.choice("adjacency", root.attributes.get("adjacency", "joined"), ("joined", "listed", *get_args(Rule)), "rule")
    if given == "listed":
        return tested_pairs(draft.shapes, "field", {}, own=True), tested_pairs(draft.shapes, "solid", {}), {}
    if given == "joined":
        untested = merged(joined_links(joints), hand_links(draft.subtree, draft.hands))
        return tested_pairs(draft.shapes, "field", untested), tested_pairs(draft.shapes, "solid", untested), untested
    if len(draft.elements) > MOST_ELEMENTS_2014:
        root.fail("adjacency", f"the rule of 2014 is for at most {MOST_ELEMENTS_2014} links and joints", 'Write adjacency="joined"')
    rule: Rule = "published_2014" if given == "published_2014" else "recorded_2014"
    field_pairs, solid_pairs = (published_pairs(draft.elements, draft.hosts, draft.shapes, role, rule) for role in ("field", "solid"))
    tested = link_pairs(draft.shapes, field_pairs, solid_pairs)
    reasons = published_untested(draft.elements, draft.hosts, draft.shapes, rule)
    return field_pairs, solid_pairs, {pair: reason for pair, reason in reasons.items() if pair not in tested}


def _with_others(robot: Robot, draft: Draft) -> Robot:
    """The robot of this file, if it has a body, and those of other files."""
    node, _ = draft.others[-1]
    own = [Placed("", robot)] if draft.parts or draft.shapes or draft.markers or draft.bodies else []
    placed = own + [other for _, other in draft.others]
    if sum(len(one.robot.shapes) for one in placed) > MOST_SHAPES or sum(len(one.robot.joints) for one in placed) > MOST_JOINTS:
        node.fail("file", f"more than {MOST_SHAPES} shapes or {MOST_JOINTS} joints in all", "Include fewer or simpler robots")
    try:
        joined = join_placed(placed, robot.name)
    except InvalidValue as error:
        node.fail("name", str(error), "Names begin with the name of their <robot>, where it has one")
    return replace(joined, where={("robot", robot.name): robot.where[("robot", robot.name)], **joined.where})
