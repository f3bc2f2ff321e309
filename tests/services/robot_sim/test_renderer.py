# SPDX-License-Identifier: Apache-2.0
"""The renderer: its drawing without a bus, and the process on one."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema.messages import Camera, Image, PartStatus, Tick
from mobee import World, box, cylinder, load_world, sphere
from mobee.rendering.scene import BACKGROUND, Scene
from mobee.robot.cameras import camera_frame, cameras_of
from mobee.robot.load import load_robot
from mobee.vision.imperfections import CameraSettings
from services.common.cameras import frame_at_capture
from tests.services.harness import wait_for
from tests.services.robots import seer
from tests.services.stage import LOOKING_DOWN, TICK, Stage, posture

ROBOT = load_robot("icub")
EYES = cameras_of(ROBOT)
DOWN = posture(ROBOT, LOOKING_DOWN)
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])


def red(picture: np.ndarray) -> np.ndarray:
    return (picture[..., 0] > 100) & (picture[..., 1] < 60)


def project(scene: Scene, eye: str, q: np.ndarray, point: np.ndarray) -> np.ndarray:
    origin, rotation = frame_at_capture(ROBOT, EYES[eye], q)
    x, y, depth = rotation.T @ (point - origin)
    return (scene.intrinsics(eye) @ np.array([x / depth, y / depth, 1.0]))[:2]


@pytest.fixture
def scene() -> Scene:
    return Scene(ROBOT, load_world("table"))


AHEAD = {"neck_pitch": 0.0, "eyes_tilt": 0.0, "eyes_vergence": 0.0}


def test_at_zero_the_eyes_look_ahead_and_stand_upright() -> None:
    transforms = np.broadcast_to(np.eye(4), (len(ROBOT.links), 4, 4))
    for eye, side in (("left", -0.034), ("right", 0.034)):
        origin, rotation = camera_frame(EYES[eye], transforms)
        np.testing.assert_allclose(origin[1], side, atol=1e-6)
        np.testing.assert_allclose(rotation, [[0, 0, -1], [1, 0, 0], [0, -1, 0]], atol=1e-12)


@pytest.mark.parametrize(("motor", "column", "row"), [("eyes_version", 1, 0), ("eyes_tilt", 0, -1), ("neck_pitch", 0, -1)])
def test_motors_turn_both_eyes_the_same_way(motor: str, column: int, row: int) -> None:
    for eye in EYES:
        views = [frame_at_capture(ROBOT, EYES[eye], q)[1] for q in (posture(ROBOT, AHEAD), posture(ROBOT, AHEAD | {motor: 10.0}))]
        turned = views[0].T @ views[1][:, 2]  # the new direction of view, in the old picture's axes
        np.testing.assert_allclose(turned[:2], np.sin(np.deg2rad(10.0)) * np.array([column, row]), atol=1e-9)


def test_vergence_turns_the_eyes_towards_each_other() -> None:
    q = posture(ROBOT, {"eyes_vergence": 20.0})
    left, right = (frame_at_capture(ROBOT, EYES[eye], q)[1][:, 2] for eye in EYES)
    np.testing.assert_allclose(left[1], np.sin(np.deg2rad(10.0)), atol=1e-9)
    np.testing.assert_allclose(right[1], -np.sin(np.deg2rad(10.0)), atol=1e-9)


def test_the_ball_is_drawn_where_intrinsics_and_posture_say(scene: Scene) -> None:
    scene.pose(DOWN)
    for eye in EYES:
        rows, columns = np.nonzero(red(scene.draw(eye)))
        seen = np.array([columns.mean(), rows.mean()])
        np.testing.assert_allclose(seen, project(scene, eye, DOWN, np.array([-0.35, 0.0, -0.07])), atol=0.6)  # perspective: .4 px


def test_objects_anywhere_in_the_picture_keep_to_the_intrinsics() -> None:
    offsets = []
    for x, y in ((-0.45, -0.06), (-0.40, 0.05), (-0.30, 0.0), (-0.32, 0.06)):
        world = World()
        world.add("mark", cylinder(0.008, 0.01), position=(x, y, -0.05), color=(1, 0, 0))
        scene = Scene(ROBOT, world)
        scene.pose(DOWN)
        rows, columns = np.nonzero(red(scene.draw("left")))
        offsets.append([columns.mean(), rows.mean()] - project(scene, "left", DOWN, np.array([x, y, -0.05])))
    assert np.abs(np.mean(offsets, axis=0)).max() < 0.2  # px


def test_near_objects_hide_far_ones() -> None:
    world = World()
    world.add("ball", sphere(0.03), position=(-0.35, 0.0, -0.07), color=(1, 0, 0))
    world.add("lid", box(0.2, 0.2, 0.01), position=(-0.33, 0.0, -0.02))
    scene = Scene(ROBOT, world)
    scene.pose(DOWN)
    hidden = red(scene.draw("left")).sum()
    scene.place("lid", np.array([-0.33, 0.0, -0.3]), NO_TURN)
    assert hidden == 0
    assert red(scene.draw("left")).sum() > 500


def test_the_robot_has_no_red_on_it(scene: Scene) -> None:
    scene.place("ball", np.array([0.0, 0.0, -5.0]), NO_TURN)
    q = posture(ROBOT, {**LOOKING_DOWN, "l_shoulder_pitch": -50.0, "r_shoulder_pitch": -50.0, "l_elbow": 60.0, "r_elbow": 60.0})
    scene.pose(q)
    for eye in EYES:
        picture = scene.draw(eye).astype(int)
        assert (picture.max(axis=2) - picture.min(axis=2)).max() < 40
        assert (picture != BACKGROUND).any(axis=2).mean() > 0.5


def test_a_hull_is_drawn_as_the_box_that_it_is(tmp_path: Path) -> None:
    place = 'px="-0.35" pz="0.2"'
    corners = " ".join(f"{x} {y} {z}" for x, y, z in product((-0.05, 0.05), (-0.1, 0.1), (-0.04, 0.04)))
    pictures = []
    for block in (
        f'<box name="block" width="0.1" height="0.2" depth="0.08" {place}/>',
        f'<convex name="block" points="{corners}" {place}/>',
    ):
        (tmp_path / "seer.xml").write_text(seer(block))
        robot = load_robot(tmp_path / "seer.xml")
        scene = Scene(robot, World())
        for turn in (0.0, 0.4):
            scene.pose(robot.home + [turn, 0.0])
            pictures.append(scene.draw("left").astype(int))
    for box_drawn, hull_drawn in ((pictures[0], pictures[2]), (pictures[1], pictures[3])):
        assert (box_drawn != BACKGROUND).any(axis=2).mean() > 0.05
        assert np.abs(box_drawn - hull_drawn).max() <= 2
    assert (pictures[2] != pictures[3]).any()


def test_pictures_are_drawn_in_pairs_and_only_for_subscribers(free_port: int) -> None:
    stage = Stage(free_port)
    try:
        with stage.running("services.robot_sim.renderer", "renderer"):
            stage.play(DOWN, lambda: stage.k > 60)
            assert stage.stat("renderer").numbers["pairs"] == 0
            images = {eye: stage.latest(Image, eye) for eye in EYES}
            cameras = {eye: stage.latest(Camera, eye) for eye in EYES}
            ball = np.array([-0.33, 0.04, -0.07])
            stage.put_ball(ball)
            first = stage.k
            assert stage.play(lambda t: DOWN, lambda: stage.stat("renderer").numbers["pairs"] >= 5)
            seconds = (stage.k - first) * 0.01
            assert stage.stat("renderer").numbers["pairs"] <= 5.0 * seconds + 2.0  # the rate asked for
            got: dict[int, Any] = {}

            def is_whole() -> bool:
                """Of the last pair all four have come."""
                taken = {place: stream.take() for place, stream in enumerate((*images.values(), *cameras.values()))}
                got.update({place: message for place, message in taken.items() if message is not None})
                return len(got) == 4 and len({message.k_capture for message in got.values()}) == 1

            wait_for(is_whole, "both pictures and both cameras of one tick")
            assert len({message.t for message in got.values()}) == 1
            image, camera = got[0], got[2]
            pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
            origin, rotation = frame_at_capture(stage.robot, EYES["left"], np.array(camera.q))
            seen = np.array(camera.intrinsics).reshape(3, 3) @ (rotation.T @ (ball - origin))
            rows, columns = np.nonzero(red(pixels))
            np.testing.assert_allclose([columns.mean(), rows.mean()], seen[:2] / seen[2], atol=0.8)
    finally:
        stage.close()


def test_imperfect_pictures_come_after_their_latency_with_the_encoders_at_their_stamp(free_port: int) -> None:
    stage, settings = Stage(free_port), CameraSettings()
    ticks = stage.publisher(Tick)
    status = {"mode": "velocity", "gate": "armed", "faults": 0, "epoch": 1, "cmd_seq": 0, "cmd_age": 1}
    turning = 0.1 * np.arange(len(DOWN)) / len(DOWN)  # rad/s

    def q(seconds: float) -> np.ndarray:
        return DOWN + turning * seconds

    images = {eye: stage.latest(Image, eye) for eye in EYES}
    cameras = {eye: stage.latest(Camera, eye) for eye in EYES}
    pairs: list[tuple[float, Camera]] = []  # age [s] at arrival
    taken: dict[str, Any] = {}

    def enough() -> bool:
        """Send encoders and truth of the newest tick beside its clock, and take what has come."""
        k, t = stage.k, 1e-9 * stage.bus.t
        parts = {name: PartStatus(k=k, t=stage.bus.t, **status) for name in stage.robot.parts}
        ticks.put(q=q(t).tolist(), parts=parts, dt=TICK, mode="free", rate=1.0)
        stage._truth.put(q=q(t + 1e-9 * TICK).tolist(), depth=0.0, pair="", gap=-1.0, objects=[])
        for name, stream in [*((f"image {eye}", images[eye]) for eye in EYES), *((eye, cameras[eye]) for eye in EYES)]:
            message = stream.take()
            if message is not None:
                taken[name] = message
        if len(taken) == 4 and len({message.k_capture for message in taken.values()}) == 1:
            pairs.append((t - 1e-9 * taken["left"].t, taken["left"]))
            taken.clear()
        return len(pairs) >= 6

    try:
        with stage.running("services.robot_sim.renderer", "renderer", "--optics", "dragonfly", "--frame-rate", "15"):
            assert stage.play(DOWN, enough)
        for age, camera in pairs:
            assert age >= settings.latency - 5.0 * settings.jitter  # stamps have no other error: they are what the camera says
            np.testing.assert_allclose(camera.q, q(1e-9 * camera.t), atol=1e-6)
            np.testing.assert_allclose(camera.dq, turning, atol=1e-4)
            assert 2 <= camera.readings <= 7 and camera.exposure == settings.exposure  # fewer at the start
        assert np.diff([camera.t for _, camera in pairs]).min() > 0
    finally:
        stage.close()
