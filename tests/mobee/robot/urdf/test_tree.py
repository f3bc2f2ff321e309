# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.urdf.read import read_urdf
from tests.mobee.robot.urdf_files import ARM, LINKS, urdf_file

PLAIN = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>{4}</joint>'
LIMIT = '<limit lower="-1" upper="1"/>'
BASE_UPPER = PLAIN.format("shoulder", "revolute", "base", "upper", LIMIT)


def joint(kind: str, inside: str = "", name: str = "elbow", parent: str = "upper", child: str = "lower") -> str:
    return PLAIN.format(name, kind, parent, child, inside)


MALFORMED = {
    "no link": ((), r":1: <robot> link: the robot has no link. Add <link"),
    "second link": ((LINKS, '<link name="base"/>'), r":3: <link> name: a second link 'base'. The first is in line 2: rename one"),
    "second joint": ((LINKS, BASE_UPPER, joint("fixed", name="shoulder")), r":4: <joint> name: a second joint 'shoulder'.*line 3"),
    "no name": (("<link/>",), r":2: <link> name: is required and missing"),
    "no type": ((LINKS, '<joint name="a"/>'), r":3: <joint> type: is required and missing. Add type"),
    "unknown type": ((LINKS, joint("revolut")), r":3: <joint> type: unknown type of joint 'revolut'. Did you mean 'revolute'"),
    "floating": ((LINKS, joint("floating")), r":3: <joint> type: a floating joint moves freely.*Write type=\"fixed\""),
    "planar": ((LINKS, joint("planar")), r":3: <joint> type: a planar joint moves freely.*prismatic and revolute joints"),
    "no child": ((LINKS, '<joint name="a" type="fixed"><parent link="base"/></joint>'), r":3: <joint> child: is required and missing"),
    "missing parent": ((LINKS, joint("fixed", parent="uper")), r":3: <joint> parent: there is no link 'uper'. Did you mean 'upper'"),
    "missing child": ((LINKS, joint("fixed", child="hand")), r":3: <joint> child: there is no link 'hand'. Valid: base, lower, upper"),
    "two parents": (
        (*ARM, joint("fixed", name="x", parent="base")),
        r":7: <joint> child: link 'lower' is moved by joint 'elbow' \(line 5\)",
    ),
    "two roots": ((LINKS, BASE_UPPER), r":2: <link> name: link 'lower' is moved by no joint, and neither is 'base' \(line 2\)"),
    "only a loop": (
        (LINKS, BASE_UPPER, joint("fixed"), joint("fixed", name="x", parent="lower", child="base")),
        r":1: <robot> joint: every link is moved by a joint, so the joints form a loop",
    ),
    "a loop beside the base": (
        (LINKS, joint("fixed"), joint("fixed", name="x", parent="lower", child="upper")),
        r":3: <joint> child: joint 'elbow' is part of a loop that hangs on nothing",
    ),
    "own child": ((LINKS, BASE_UPPER, joint("fixed", parent="lower")), r":4: <joint> child: joint 'elbow' is part of a loop"),
    "zero axis": (
        (LINKS, BASE_UPPER, joint("revolute", '<axis xyz="0 0 0"/>')),
        r":4: <axis> xyz: the axis has no length. Write the direc",
    ),
    "short axis": ((LINKS, joint("revolute", '<axis xyz="0 1"/>')), r":3: <axis> xyz: has 2 numbers. Write 3 numbers"),
    "a number that is none": ((LINKS, joint("fixed", '<origin xyz="0 0 nan"/>')), r":3: <origin> xyz: 'nan' is not finite"),
    "text for a number": ((LINKS, joint("fixed", '<origin rpy="0 ${pi} 0"/>')), r":3: <origin> rpy: '\$\{pi\}' is not a number"),
    "an enormous number": ((LINKS, joint("fixed", '<origin xyz="0 0 1e9"/>')), r":3: <origin> xyz: 1e\+09 is too large. URDF counts in m"),
    "a blank name": ((LINKS, joint("revolute", LIMIT, name=" ")), r":3: <joint> name: is required and missing"),
    "a long name": ((LINKS, joint("revolute", LIMIT, name="j" * 201)), r":3: <joint> name: 'jj.*' has 201 letters. Give it a name of at"),
    "a long link": (('<link name="%s"/>' % ("l" * 201),), r":2: <link> name: 'll.*' has 201 letters. Give it a name of at"),
    "two origins": ((LINKS, joint("fixed", "<origin/><origin/>")), r":3: <origin> position in the file: a second <origin>"),
    "nothing moves": (
        (LINKS, joint("fixed"), joint("fixed", name="x", parent="base", child="upper")),
        r":1: <robot> joint: no joint moves",
    ),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_tree_is_refused_with_its_line_and_a_remedy(tmp_path: Path, name: str) -> None:
    lines, message = MALFORMED[name]
    with pytest.raises(RobotFileError, match=r"toy\.urdf" + message):
        read_urdf(urdf_file(tmp_path, *lines))


def test_the_axis_is_x_where_none_is_given_and_a_unit_vector_where_one_is(tmp_path: Path) -> None:
    robot = read_urdf(urdf_file(tmp_path, LINKS, BASE_UPPER, joint("revolute", f'<axis xyz="0 3 4"/>{LIMIT}')))
    assert np.array_equal(robot.joints[0].axis, [1, 0, 0])
    assert np.allclose(robot.joints[1].axis, [0, 0.6, 0.8], atol=1e-15)


def test_a_fixed_joint_may_have_an_axis_without_length(tmp_path: Path) -> None:
    robot = read_urdf(urdf_file(tmp_path, LINKS, BASE_UPPER, joint("fixed", '<axis xyz="0 0 0"/>')))
    assert robot.links == ("base", "upper")


def test_a_misspelt_tag_of_a_joint_is_named(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r":4: <orgin>: unknown tag is ignored. Did you mean 'origin'"):
        read_urdf(urdf_file(tmp_path, LINKS, BASE_UPPER, joint("revolute", f'<orgin xyz="1 0 0"/>{LIMIT}')))


def test_a_chain_of_a_thousand_links_is_read_and_a_longer_one_refused(tmp_path: Path) -> None:
    def chain(count: int) -> Path:
        links = [f'<link name="l{k}"/>' for k in range(count)]
        return urdf_file(tmp_path, *links, *(joint("revolute", LIMIT, f"j{k}", f"l{k}", f"l{k + 1}") for k in range(count - 1)))

    assert len(read_urdf(chain(1000)).joints) == 999
    with pytest.raises(RobotFileError, match="has 1001 links"):
        read_urdf(chain(1001))


XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
CALLS = {
    "an include": '<xacro:include filename="hand.xacro"/>',
    "the call of a macro": '<xacro:hand parent="lower"/>',
    "a condition": '<xacro:if value="1"><link name="hand"/></xacro:if>',
    "a call in a link": '<link name="hand"><xacro:box_inertia m="1"/></link>',
    "a call deep in a link": '<link name="hand"><collision><geometry><xacro:palm/></geometry></collision></link>',
    "a call in a joint": '<joint name="wrist" type="fixed"><xacro:insert_block name="origin"/></joint>',
    "another prefix": '<Xa:include filename="hand.xacro"/>',
}
UNUSED = {
    "nothing": "",
    "a property": '<xacro:property name="width" value="0.03"/>',
    "an argument": '<xacro:arg name="side" default="left"/>',
    "the definition of a macro": '<xacro:macro name="hand" params="side"><link name="${side}_hand"/><xacro:finger/></xacro:macro>',
    "a call in an element that is not read": "<gazebo><xacro:control/></gazebo>",
    "a call in a comment": "<!-- <xacro:hand/> -->",
    "a tag of another program": '<drake:joint name="j" type="ball"/>',
}


def xacro_file(folder: Path, line: str) -> Path:
    path = urdf_file(folder, *ARM, line)
    path.write_text(
        path.read_text().replace("<robot", f'<robot {XACRO} xmlns:Xa="http://wiki.ros.org/xacro" xmlns:drake="http://drake.mit.edu"')
    )
    return path


@pytest.mark.parametrize("name", CALLS)
def test_a_tag_that_xacro_has_not_replaced_is_refused(tmp_path: Path, name: str) -> None:
    path = xacro_file(tmp_path, CALLS[name])
    remedy = r"Run xacro first: xacro toy\.urdf > toy_expanded\.urdf"
    with pytest.raises(RobotFileError, match=rf"toy\.urdf:7: <xa(cro)?:\w+> tag: .*a part of the robot is missing\. {remedy}"):
        read_urdf(path)


@pytest.mark.parametrize("name", UNUSED)
def test_leftovers_of_xacro_that_add_nothing_are_silent(tmp_path: Path, name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_urdf(xacro_file(tmp_path, UNUSED[name])).links == ("base", "upper", "lower")
