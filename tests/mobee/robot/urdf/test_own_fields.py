# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.model.model import Model
from mobee.robot.robot import Robot
from mobee.robot.urdf.pairs import segment_distances
from mobee.robot.urdf.read import UrdfOptions, read_urdf
from tests.mobee.robot.urdf_files import foreign, srdf_file, urdf_file

BODY = '<link name="{0}"><collision><geometry>{1}</geometry></collision></link>'
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3} 0 0"/><limit lower="-3" upper="3"/></joint>'
)
SHAPES = ('<sphere radius="0.1"/>', '<box size="0.1 0.2 0.1"/>', '<cylinder radius="0.1" length="0.1"/>')
POINTS = st.lists(st.floats(-2.0, 2.0), min_size=9, max_size=9).map(lambda values: np.array(values).reshape(3, 3))


def chain(folder: Path, shape: str, step: float = 1.0) -> Path:
    """Five links in a row, each `step` metres from the one before."""
    links = [BODY.format(f"l{k}", shape) for k in range(5)]
    return urdf_file(folder, *links, *(JOINT.format(f"j{k}", f"l{k - 1}", f"l{k}", step) for k in range(1, 5)))


def field_pairs(robot: Robot) -> set[str]:
    return {"-".join(sorted(robot.links[robot.shapes[k].link] for k in pair)) for pair in robot.field_pairs.tolist()}


@pytest.mark.parametrize("shape", SHAPES)
def test_without_parts_fields_more_than_two_joints_apart_meet(tmp_path: Path, shape: str) -> None:
    robot = read_urdf(chain(tmp_path, shape), UrdfOptions(field=0.03))
    assert field_pairs(robot) == {"l0-l3", "l0-l4", "l1-l4"}


@pytest.mark.parametrize("shape", SHAPES)
def test_fields_that_overlap_as_drawn_are_left_out(tmp_path: Path, shape: str) -> None:
    robot = read_urdf(chain(tmp_path, shape, step=0.075), UrdfOptions(field=0.03))  # l0 and l3 are 0.225 m apart, l0 and l4 0.3
    assert field_pairs(robot) == {"l0-l4"}


def test_a_part_of_the_srdf_keeps_its_own_fields_apart(tmp_path: Path) -> None:
    srdf_file(tmp_path, '<group name="arm"><chain base_link="l0" tip_link="l4"/></group>')
    assert not field_pairs(read_urdf(chain(tmp_path, SHAPES[0]), UrdfOptions(field=0.03)))


def test_pairs_that_the_srdf_disables_stay_untested_without_parts(tmp_path: Path) -> None:
    srdf_file(tmp_path, '<disable_collisions link1="l0" link2="l4" reason="Never"/>')
    assert field_pairs(read_urdf(chain(tmp_path, SHAPES[0]), UrdfOptions(field=0.03))) == {"l0-l3", "l1-l4"}


@pytest.mark.parametrize("name", ["franka_panda/panda.urdf", "laikago/laikago_toes.urdf", "quadruped/minitaur.urdf", "r2d2.urdf"])
def test_no_field_of_a_robot_of_others_pushes_at_zero(name: str) -> None:
    robot = read_urdf(foreign(name), UrdfOptions(field=0.03))
    contacts = Model(robot).evaluate(np.zeros(len(robot.motors))).contacts
    assert len(robot.field_pairs)
    assert not [contact for contact in contacts if contact.kind == "field"]


@given(POINTS, st.sampled_from([0.0, 1.0]), st.sampled_from([0.0, 1.0]))
def test_distances_of_segments_are_those_of_their_nearest_points(vectors: Array, first: float, second: float) -> None:
    """With a factor of 0 a segment is a point."""
    offset, along, across = vectors[0], first * vectors[1], second * vectors[2]
    found = float(segment_distances(offset[None], along, across[None])[0])
    share = np.linspace(-1.0, 1.0, 201)
    gaps = offset + share[:, None, None] * along - share[None, :, None] * across
    least = float(np.linalg.norm(gaps, axis=2).min())
    assert least - 0.005 * (np.linalg.norm(along) + np.linalg.norm(across)) - 1e-9 <= found <= least + 1e-9
