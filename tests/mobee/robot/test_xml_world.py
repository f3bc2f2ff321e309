# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.model.world_file import load_world, read_world


def written(folder: Path, *lines: str) -> Path:
    path = folder / "room.xml"
    path.write_text("\n".join(['<World name="room">', *lines, "</World>"]), encoding="utf-8")
    return path


def test_the_table_is_a_thick_block_with_a_red_ball_on_it() -> None:
    objects = load_world("table").objects
    table, ball = objects["table"], objects["ball"]
    half = np.array(table.size) / 2
    np.testing.assert_allclose(table.position - half, [-0.74, -0.75, -0.6], atol=1e-12)
    np.testing.assert_allclose(table.position + half, [-0.14, 0.75, -0.1], atol=1e-12)
    np.testing.assert_allclose(table.rotation, np.eye(3))
    assert (ball.kind, ball.size, ball.role) == ("sphere", (0.03,), "target")
    np.testing.assert_allclose(ball.position, [-0.35, 0, -0.07])
    assert ball.color is not None and ball.color[0] > 0.8 > 0.2 > max(ball.color[1:3])


def test_the_world_of_2014_keeps_its_numbers() -> None:
    objects = load_world("table_2014").objects
    assert {name: thing.role for name, thing in objects.items()} == {"table": "obstacle", "ball": "target", "cylinder": "obstacle"}
    np.testing.assert_allclose(objects["cylinder"].rotation[:, 2], np.full(3, 3**-0.5))
    assert objects["table"].size == (1, 1.5, 0.001)


def test_an_object_with_a_mass_is_movable(tmp_path: Path) -> None:
    path = written(tmp_path, '<sphere name="a" radius="1" mass="0.2" friction="0.8"/>', '<sphere name="b" radius="1" friction="0.8"/>')
    with pytest.warns(UserWarning, match="friction is ignored"):
        objects = read_world(path).objects
    assert (objects["a"].movable, objects["a"].mass, objects["a"].friction) == (True, 0.2, 0.8)
    assert not objects["b"].movable


def test_two_worlds_do_not_share_their_objects() -> None:
    first, second = load_world("table"), load_world("table")
    first.remove("ball")
    assert "ball" in second.objects


BAD = {
    "role": ('<sphere name="a" radius="1" role="obstacel"/>', "<sphere> role: unknown role 'obstacel'. Did you mean 'obstacle'?"),
    "name": ('<sphere radius="1"/>', "<sphere> name: is required and missing"),
    "twice": ('<sphere name="a" radius="1"/><sphere name="a" radius="1"/>', "<sphere> name: a second object 'a'"),
    "colour": ('<sphere name="a" radius="1" color="1 0 2"/>', "<sphere> color: '1 0 2' is no colour"),
    "mass": ('<sphere name="a" radius="1" mass="-1"/>', "<sphere> mass: -1 is not positive"),
    "friction": ('<sphere name="a" radius="1" mass="1" friction="-1"/>', "<sphere> size or place: world object 'a': friction -1.0"),
    "size": ('<sphere name="a" radius="0"/>', "<sphere> radius: 0 is not positive"),
}


@pytest.mark.parametrize("case", BAD)
def test_errors_name_file_line_field_and_remedy(tmp_path: Path, case: str) -> None:
    line, message = BAD[case]
    path = written(tmp_path, line)
    with pytest.raises(RobotFileError) as caught:
        read_world(path)
    assert str(caught.value).startswith(f"{path}:2: {message}")


def test_unknown_tags_are_ignored_with_a_warning(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"room.xml:2: <spere>: unknown tag is ignored. Did you mean 'sphere'"):
        assert not read_world(written(tmp_path, "<spere/>")).objects


def test_a_robot_is_no_world(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text("<ZeroPositionKinematicTree/>", encoding="utf-8")
    with pytest.raises(RobotFileError, match="this is not a world"):
        read_world(path)
