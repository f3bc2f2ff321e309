# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import InvalidValue, UnknownName
from mobee.model.kinematics import link_transforms
from mobee.robot.cameras import camera_frame, cameras_of, upright
from mobee.robot.load import load_robot

EYED = """<ZeroPositionKinematicTree version="2.0" robotName="eyed"><bodypart name="arm"><motor name="pan" minPos="-90" maxPos="90">
<joint z="1" moves="turret"><link z="0.5" radius="0.02"><camera name="Front Left" pz="0.1" nx="1" view="60"/><camera name="b"/>
<camera name="c" nx="0" nz="-1" hides="turret"/><link><marker name="tip" nx="0" ny="1"/></link></link></joint></motor></bodypart>
</ZeroPositionKinematicTree>"""


def test_the_eyes_of_the_icub_are_its_cameras_and_do_not_see_the_head() -> None:
    icub = load_robot("icub")
    cameras = cameras_of(icub)
    assert list(cameras) == ["left", "right"]
    hidden = {icub.links[link] for link in cameras["left"].hidden}
    assert "head" in hidden and "chest" not in hidden


def test_the_first_two_of_a_file_and_those_that_are_asked_for(tmp_path: Path) -> None:
    (tmp_path / "eyed.xml").write_text(EYED)
    robot = load_robot(tmp_path / "eyed.xml")
    assert list(cameras_of(robot)) == ["front_left", "b"]
    cameras = cameras_of(robot, ["c", "b", "tip", "tip=0,0,0.1", "turret=0,0,1,0,1,0"])
    assert list(cameras) == ["front_left", "b", "c", "tip", "tip_2", "turret"]
    transforms = link_transforms(robot, np.array([np.pi / 2]))
    place, rotation = camera_frame(cameras["front_left"], transforms)
    np.testing.assert_allclose(place, [0.0, 0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(rotation[:, 2], [0.0, 1.0, 0.0], atol=1e-12)  # turned with its link
    assert cameras["front_left"].view_deg == 60.0
    assert (cameras["c"].hidden, cameras["tip"].hidden, cameras["tip_2"].hidden) == ({1}, {1}, set())
    np.testing.assert_allclose(cameras["tip"].rotation, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)  # right, down, ahead
    np.testing.assert_allclose(cameras["tip_2"].position, [0.0, 0.1, 0.5], atol=1e-12)  # along the marker's z, which is its normal
    np.testing.assert_allclose(cameras["turret"].position, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(cameras["turret"].rotation[:, 2], [0.0, 1.0, 0.0])


@pytest.mark.parametrize("view", [(0.0, 0.0, 1.0), (0.0, 5e-4, -1.0), (7e-4, 7e-4, 1.0), (0.0, 2e-3, 1.0), (1.0, 2.0, -3.0)])
def test_a_picture_is_upright_or_at_least_right_angled(view: tuple[float, float, float]) -> None:
    ahead = np.array(view) / np.linalg.norm(view)
    rotation = upright(ahead)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation[:, 2], ahead)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_a_camera_that_cannot_be_made_is_refused() -> None:
    robot = load_robot("katana")
    with pytest.raises(UnknownName, match="unknown link or marker 'hand'"):
        cameras_of(robot, ["hand"])
    with pytest.raises(InvalidValue, match="'1,2' is neither three nor six numbers. Write NAME, NAME=x,y,z"):
        cameras_of(robot, [f"{robot.links[0]}=1,2"])
    with pytest.raises(InvalidValue, match="the direction of view has no length"):
        cameras_of(robot, [f"{robot.links[0]}=1,2,3,0,0,0"])
