# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue, UnknownName
from mobee.model.world_object import sphere
from mobee.rendering.sheet import Motion, Strip, cloud_solids, filmstrip, marker_cloud, motion_through, panels, recorded
from mobee.rendering.solid import PALENESS, link_solids, object_solids, robot_solids, trail_solids

ARM = ["r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow"]
PALM = "right_palm"


@pytest.fixture(scope="module")
def model() -> mobee.Model:
    world = mobee.World()
    world.add("ball", sphere(0.05), position=(-0.3, 0.1, 0.1), role="target")
    world.add("ghost", sphere(0.05), position=(-0.3, 0.3, 0.1), role="ghost")
    return mobee.Model(mobee.load_robot("icub"), world)


@pytest.fixture(scope="module")
def motion(model: mobee.Model) -> Motion:
    q = np.tile(model.robot.home, (30, 1))
    q[:, model.robot.motor_index("r_shoulder_roll")] += np.linspace(0.0, 1.0, 30) ** 2
    return motion_through(model, q, 0.05 * np.arange(30))


def test_a_trail_begins_where_the_marker_was_and_ends_in_a_ball_at_the_palm(motion: Motion) -> None:
    *pieces, tip = trail_solids(motion.path(PALM)[:20])
    np.testing.assert_array_equal(tip.position, motion.poses[19].position(PALM))
    first, last = pieces[0], pieces[-1]
    np.testing.assert_allclose(first.position - 0.5 * first.size[1] * first.rotation[:, 2], motion.poses[0].position(PALM), atol=1e-12)
    np.testing.assert_allclose(last.position + 0.5 * last.size[1] * last.rotation[:, 2], tip.position, atol=1e-12)


def test_a_trail_of_one_place_is_a_ball(motion: Motion) -> None:
    assert [solid.kind for solid in trail_solids(motion.path(PALM)[:1])] == ["sphere"]


def test_moments_are_the_first_the_last_and_equally_far_from_each_other(motion: Motion) -> None:
    moments = motion.moments(PALM, 4)
    assert moments[0] == 0 and moments[-1] == 29 and len(moments) == 4
    gone = np.cumsum(np.linalg.norm(np.diff(motion.path(PALM), axis=0), axis=1))
    between = np.diff(np.concatenate([[0.0], gone])[moments])
    np.testing.assert_allclose(between, between.mean(), rtol=0.25)
    assert motion.moments(PALM, 1).tolist() == [29]


def test_a_motion_knows_which_parts_moved(motion: Motion) -> None:
    assert motion.moved() == ("right_arm",)


def test_the_robot_is_drawn_where_its_links_carry_it_and_other_parts_are_pale(model: mobee.Model) -> None:
    pose = model.evaluate(model.robot.home)
    expected = link_solids(model.robot)
    solids = robot_solids(pose, ["right_arm"])
    assert len(solids) == len(expected) > 0
    for solid, one in zip(solids, expected, strict=True):
        link = pose.transforms[one.link]
        np.testing.assert_allclose(solid.position, link[:3, :3] @ one.solid.position + link[:3, 3], atol=1e-12)
        white = 0.0 if one.part == "right_arm" else PALENESS
        np.testing.assert_allclose(solid.color, white + (1.0 - white) * np.array(one.solid.color))


def test_targets_are_red_and_ghosts_are_seen_through(model: mobee.Model) -> None:
    target, ghost = object_solids(model.world.objects)
    assert target.color[0] > 2.0 * max(target.color[1:]) and target.opacity == 1.0
    assert ghost.opacity < 1.0


def test_a_recording_holds_each_step_of_a_plant_with_the_world_as_it_was(model: mobee.Model) -> None:
    world = mobee.World()
    world.add("ball", sphere(0.02), position=(-0.5, 0.5, 0.1), role="ghost")
    plant = mobee.OfflinePlant(mobee.Model(model.robot, world), 0, active=ARM)
    plant.run(10)
    goal = plant.measure("right_arm")
    goal[0] -= 0.2
    with recorded(plant, 0.05) as recording:
        plant.act("right_arm", goal)
        world.move("ball", position=(-0.5, 0.6, 0.1))
        plant.run(5)
    plant.run(20)
    motion = recording.motion()
    np.testing.assert_allclose(np.diff(motion.times)[1:], 0.05, atol=1e-9)
    assert motion.times[0] == 0.0
    assert motion.objects[0]["ball"].position[1] == 0.5 and motion.objects[-1]["ball"].position[1] == 0.6
    np.testing.assert_allclose(motion.poses[-1].q[model.robot.part("right_arm").slice][0], goal[0], atol=0.05)


def test_a_filmstrip_has_a_row_a_view_of_equal_pictures_and_captions_below_the_last(motion: Motion, tmp_path: Path) -> None:
    rows = panels(Strip(motion.part(0, 10), PALM, views=("oblique", (30.0, 60.0)), poses=2), 30)
    assert [len(row) for row in rows] == [2, 2]
    assert {panel.picture.shape[0] for row in rows for panel in row} == {30}
    assert [panel.caption for panel in rows[0]] == ["", ""] and [panel.caption for panel in rows[1]] == ["0.0 s", "0.5 s"]
    assert rows[0][0].picture.shape == rows[0][1].picture.shape and (rows[0][0].picture != rows[0][1].picture).any()


def test_a_filmstrip_is_written_as_one_picture(motion: Motion, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from PIL import Image

    path = filmstrip([Strip(motion.part(0, 5), PALM, poses=2, title="a motion")], tmp_path / "film.png", height=50)
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert (pixels[0] == 255).all() and len(pixels) == 50 + 22 + 30 + 20  # picture, caption, title, margins
    assert (np.ptp(pixels.astype(int), axis=2) > 60).any()  # the trail and the arm are in colour


def test_a_picture_stays_whole_if_the_next_one_cannot_be_written(motion: Motion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    from PIL import Image

    strips, path = [Strip(motion.part(0, 1), PALM, poses=1, title=r"titles are plain: $\frac$, $5")], tmp_path / "film.png"
    before = filmstrip(strips, path, height=20).read_bytes()
    save = Image.Image.save

    def full(self: Image.Image, file: object, *given: object, **options: object) -> None:
        if "optimize" in options:
            file = path.open("wb") if file == path else file  # as Pillow does for a name
            file.write(b"half")
            raise OSError(28, "No space left on device")
        save(self, file, *given, **options)

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(OSError, match="No space left"):
        filmstrip(strips, path, height=20)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_a_cloud_has_a_point_where_the_marker_is_in_each_pose_coloured_by_its_value(motion: Motion, model: mobee.Model) -> None:
    places = motion.path(PALM)[:3]
    points = [solid for solid in cloud_solids(motion.poses[0], places, np.array([0.0, 1.0, 0.0])) if solid.group == -3]
    np.testing.assert_array_equal([point.position for point in points], places)
    assert points[0].color == points[2].color != points[1].color


def test_a_cloud_is_written_and_needs_one_value_per_pose(model: mobee.Model, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    q = np.tile(model.robot.home, (4, 1))
    assert marker_cloud(model, q, PALM, tmp_path / "cloud.png", views=("top",), height=30).stat().st_size > 0
    angles = np.array([[0.0, 10.0], [90.0, 0.0]])
    assert marker_cloud(model, q, PALM, tmp_path / "cloud.png", views=angles, height=30).stat().st_size > 0  # type: ignore[arg-type]
    with pytest.raises(InvalidValue, match="one value per pose"):
        marker_cloud(model, q, PALM, tmp_path / "cloud.png", values=[1.0])
    with pytest.raises(InvalidValue, match="1 of 4 are not finite"):
        marker_cloud(model, q, PALM, tmp_path / "cloud.png", values=[1.0, 2.0, np.nan, 3.0])
    with pytest.raises(InvalidValue, match="0 views"):
        marker_cloud(model, q, PALM, tmp_path / "cloud.png", views=())


def test_mistakes_are_refused(motion: Motion, tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="at least one"):
        panels(Strip(motion, PALM, poses=0), 40)
    with pytest.raises(UnknownName):
        panels(Strip(motion, "rigth_palm"), 40)
    with pytest.raises(InvalidValue, match="view .*must be an array of numbers"):
        panels(Strip(motion, PALM, views=(("a", "b"),)), 40)  # type: ignore[arg-type]
    with pytest.raises(InvalidValue, match="height 0"):
        panels(Strip(motion, PALM), 0)
    with pytest.raises(InvalidValue, match="two finite numbers"):
        panels(Strip(motion, PALM, views=((np.nan, 0.0),)), 40)
    with pytest.raises(InvalidValue, match="colors 257"):
        filmstrip([Strip(motion.part(0, 0), PALM)], tmp_path / "film.png", 20, colors=257)
    with pytest.raises(InvalidValue, match="as many of each"):
        Motion(motion.poses, motion.times[:3], motion.objects)
