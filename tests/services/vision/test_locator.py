# SPDX-License-Identifier: Apache-2.0
"""The target locator: what is a ball, where it is, and what the process reads."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import cv2
import numpy as np
import pytest

from bus_schema.messages import (
    Camera,
    Clock,
    Command,
    Commands,
    Contacts,
    Event,
    Forces,
    Image,
    Message,
    Motion,
    Pose,
    State,
    Tick,
    Transition,
    Truth,
    WorldObject,
)
from mobee import World, load_world, sphere
from mobee.rendering.scene import Scene
from mobee.robot.cameras import cameras_of
from mobee.robot.load import load_robot
from mobee.robot.robot import Camera as Camera3D
from mobee.robot.robot import Robot
from mobee.vision.ball import find_balls
from mobee.vision.encoders import Moment
from mobee.vision.lens import Lens
from mobee.vision.objects.detectors import detector_of
from mobee.vision.objects.placing import Placed, eyes_at, locate_all
from mobee.vision.objects.thing import things_in
from mobee.vision.rig import Rig
from services.common.cameras import frame_at_capture
from tests.services.stage import LOOKING_DOWN, TICK, Stage, matched, posture

ROBOT = load_robot("icub")
EYES = cameras_of(ROBOT)
K = np.array([[257.34, 0.0, 160.0], [0.0, 257.34, 119.0], [0.0, 0.0, 1.0]])
RED, GREY = (215, 20, 20), (150, 150, 150)
RADIUS = 0.03
THINGS = things_in(load_world("table"))
DETECT = detector_of("color", THINGS)


def blank() -> np.ndarray:
    return np.full((240, 320, 3), GREY, np.uint8)


def sphere_picture(center: np.ndarray, radius: float) -> np.ndarray:
    """A ball at center (3,) m in the camera's frame, ray by ray."""
    columns, rows = np.meshgrid(np.arange(320), np.arange(240))
    rays = np.stack([(columns - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1], np.ones_like(rows, float)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    picture = blank()
    picture[rays @ center > np.sqrt(center @ center - radius**2)] = RED
    return picture


@pytest.mark.parametrize("center", [(0.0, 0.0, 0.4), (0.15, 0.1, 0.35), (-0.2, -0.12, 0.4), (0.05, -0.15, 0.6)])
def test_direction_and_distance_of_a_ball_carry_no_bias_of_perspective(center: tuple[float, ...]) -> None:
    at = np.array(center)
    (seen,) = find_balls(sphere_picture(at, RADIUS), K)
    pixels_off = K[0, 0] * np.arccos(min(1.0, seen.direction @ at / np.linalg.norm(at)))
    assert pixels_off < 0.25
    assert seen.distance(RADIUS) == pytest.approx(np.linalg.norm(at), rel=0.03)


@pytest.mark.parametrize("hidden", [0.1, 0.2])
def test_a_ball_that_is_partly_hidden_is_still_found(hidden: float) -> None:
    at = np.array([0.03, 0.02, 0.4])
    picture = sphere_picture(at, RADIUS)
    columns = np.nonzero((picture == RED).all(axis=2))[1]
    picture[:, int(np.quantile(columns, 1.0 - hidden)) :] = GREY
    (seen,) = find_balls(picture, K)
    assert K[0, 0] * np.arccos(min(1.0, seen.direction @ at / np.linalg.norm(at))) < 1.0


@pytest.mark.parametrize(("length", "thick"), [(60, 10), (90, 16), (140, 24), (60, 20)])
@pytest.mark.parametrize("angle", [0.0, 0.7, 1.5])
def test_a_red_arm_is_no_ball(length: int, thick: int, angle: float) -> None:
    picture = blank()
    reach = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
    first, second = (np.array([160, 120]) + sign * reach for sign in (-1, 1))
    cv2.line(picture, tuple(int(v) for v in first), tuple(int(v) for v in second), RED, 2 * thick)  # round ends
    assert find_balls(picture, K) == []


def test_a_red_square_a_speck_and_a_grey_ball_are_no_balls() -> None:
    picture = blank()
    cv2.rectangle(picture, (40, 40), (110, 110), RED, -1)
    cv2.circle(picture, (200, 120), 2, RED, -1)
    cv2.circle(picture, (250, 120), 20, (90, 90, 95), -1)
    assert find_balls(picture, K) == []


def test_a_ball_cut_by_the_picture_s_edge_is_not_taken_for_a_smaller_one() -> None:
    at = np.array([0.6 * 0.4, 0.0, 0.4])
    assert all(seen.distance(RADIUS) == pytest.approx(np.linalg.norm(at), rel=0.1) for seen in find_balls(sphere_picture(at, RADIUS), K))


def located(scene: Scene, robot: Robot, cameras: Mapping[str, Camera3D], q: np.ndarray) -> list[Placed]:
    """What the two cameras of a robot see at a posture, without errors of encoders."""
    scene.pose(q)
    rig = Rig(robot, cameras, Lens.of_matrix(scene.intrinsics(next(iter(cameras))), np.zeros(0)))
    eyes = eyes_at(rig, np.zeros(len(rig.names)), Moment(q, np.zeros(len(q)), np.full(len(q), 1e-6)))
    return locate_all(THINGS, {name: DETECT(scene.draw(name)) for name in cameras}, eyes)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(ROBOT, load_world("table"))


def test_the_drawn_ball_is_located_within_a_centimetre(scene: Scene, rng: np.random.Generator) -> None:
    """Median 1 cm, 95 % 2 cm over frames in which both eyes see 90 % of the ball, at ten places."""
    errors = []
    for _ in range(10):
        at = np.array([rng.uniform(-0.45, -0.28), rng.uniform(-0.12, 0.12), rng.uniform(-0.07, 0.05)])
        scene.place("ball", at, np.array([1.0, 0.0, 0.0, 0.0]))
        for _ in range(4):
            moved = {"torso_pitch": rng.uniform(2, 25), "torso_yaw": rng.uniform(-12, 12), "torso_roll": rng.uniform(-6, 6)}
            q = posture(ROBOT, {**LOOKING_DOWN, **moved})
            found = located(scene, ROBOT, EYES, q)
            frames = tuple(frame_at_capture(ROBOT, EYES[eye], q) for eye in EYES)
            pictures = [scene.draw(eye) for eye in EYES]
            if min(share_seen(picture, frame, at, scene.intrinsics("left")) for picture, frame in zip(pictures, frames, strict=True)) < 0.9:
                continue
            errors.append(np.linalg.norm(found[0].position - at) if found else np.inf)
    assert len(errors) >= 20
    assert np.median(errors) < 0.01
    assert np.quantile(errors, 0.95) < 0.02


def test_two_cameras_put_on_any_robot_locate_the_ball() -> None:
    robot, world, at = load_robot("katana"), World(), np.array([0.5, 0.05, 0.35])
    base = robot.links[0]
    cameras = cameras_of(robot, [f"{base}=1,-0.1,0.4,-1,0,0", f"{base}=1,0.1,0.4,-1,0,-0.1"])
    world.add("ball", sphere(RADIUS), position=at, color=(1, 0, 0))
    (found,) = located(Scene(robot, world, cameras), robot, cameras, robot.home)
    np.testing.assert_allclose(found.position, at, atol=0.005)


def share_seen(picture: np.ndarray, frame: tuple[np.ndarray, np.ndarray], at: np.ndarray, intrinsics: np.ndarray) -> float:
    """Red pixels by the solid angle of the whole ball."""
    center = frame[1].T @ (at - frame[0])
    if center[2] <= 0.0:
        return 0.0
    distance, cosine = np.linalg.norm(center), center[2] / np.linalg.norm(center)
    whole = 2.0 * np.pi * (1.0 - np.sqrt(1.0 - (RADIUS / distance) ** 2)) * (intrinsics[0, 0] ** 2) / cosine**3
    return float(((picture[..., 0] > 100) & (picture[..., 1] < 60)).sum() / whole)


PARTS = ("torso", "head", "left_arm", "right_arm")
ALLOWED: dict[str, type[Message]] = {Clock.stream.key(): Clock} | {
    key: cls for eye in EYES for key, cls in ((Image.stream.key(eye), Image), (Camera.stream.key(eye), Camera))
}
FORBIDDEN: dict[str, type[Message]] = {
    **{State.stream.key(part): State for part in PARTS},
    **{Motion.stream.key(part): Motion for part in PARTS},
    **{Command.stream.key(part): Command for part in PARTS},
    Tick.stream.key(): Tick,
    Commands.stream.key(): Commands,
    Truth.stream.key(): Truth,
    Forces.stream.key("model"): Forces,
    Pose.stream.key(): Pose,
    Contacts.stream.key(): Contacts,
    WorldObject.stream.key("ball"): WorldObject,
    Transition.stream.key("torso"): Transition,
    Event.stream.key("stage"): Event,
}


@pytest.fixture
def stage(free_port: int) -> Iterator[Stage]:
    made = Stage(free_port)
    yield made
    made.close()


def test_it_reads_pictures_cameras_and_the_run_s_clock_only(stage: Stage) -> None:
    with stage.running("services.vision", "vision"):
        assert [key for key, cls in ALLOWED.items() if not matched(stage, key, cls, 10.0)] == []
        assert [key for key, cls in FORBIDDEN.items() if matched(stage, key, cls, 0.1)] == []


def test_the_process_places_the_ball_of_a_pair_of_pictures(stage: Stage) -> None:
    q = posture(ROBOT, LOOKING_DOWN)
    at = np.array([-0.36, 0.03, -0.07])
    with stage.running("services.vision", "vision"):
        found = stage.latest(WorldObject, "ball")
        put = pair_putter(stage, q, at)
        got: list[WorldObject] = []

        def located() -> bool:
            if stage.k % 20 == 5:
                put(stage.k)
            message = found.take()
            return message is not None and not got.append(message)

        assert stage.play(q, located)
    (ball,) = got
    np.testing.assert_allclose(ball.position, at, atol=0.003)
    assert (ball.geometry.kind, ball.geometry.size, ball.role) == ("sphere", [RADIUS], "target")
    assert ball.t_capture % (20 * TICK) == 5 * TICK
    assert ball.valid_until > ball.t_capture
    assert np.linalg.eigvalsh(np.array(ball.covariance).reshape(3, 3)).min() > 0.0


def test_pictures_of_different_ticks_are_not_paired_and_bad_ones_do_no_harm(stage: Stage) -> None:
    q = posture(ROBOT, LOOKING_DOWN)
    with stage.running("services.vision", "vision") as process:
        put = pair_putter(stage, q, np.array([-0.36, 0.03, -0.07]))

        def harassed() -> bool:
            wrong = ({"late": stage.k + 500}, {"size": 100}, {"posture": [0.0] * 3})[stage.k % 3]
            put(stage.k, **wrong)
            return stage.k > 60

        assert stage.play(q, harassed)
        assert stage.play(q, lambda: harassed() and {"length", "camera"} <= stage.stat("vision").rejected.keys())
        assert stage.stat("vision").numbers["located"] == 0
        assert process.poll() is None


def pair_putter(stage: Stage, q: np.ndarray, at: np.ndarray) -> Callable[..., None]:
    """A function that puts both eyes' pictures of a ball and their cameras, right or wrong in one way."""
    images = {eye: stage.publisher(Image, eye) for eye in EYES}
    cameras = {eye: stage.publisher(Camera, eye) for eye in EYES}
    pictures = {}
    for eye in EYES:
        origin, rotation = frame_at_capture(ROBOT, EYES[eye], q)
        pictures[eye] = sphere_picture(rotation.T @ (at - origin), RADIUS).tobytes()

    def put(
        k: int,
        late: int | None = None,
        size: int | None = None,
        posture: list[float] | None = None,
        exposure: float = 0.0,
        change: Callable[[bytes], bytes] = bytes,
    ) -> None:
        for eye in EYES:
            k_capture = late if late is not None and eye == "right" else k
            stamp = {"k": k, "t": k * TICK, "camera": eye, "k_capture": k_capture}
            encoders = {"q": q.tolist() if posture is None else posture, "dq": [0.0] * len(q), "readings": 1}
            cameras[eye].put(**stamp, intrinsics=K.ravel().tolist(), distortion=[], exposure=exposure, **encoders)
            images[eye].put(**stamp, width=320, height=240, encoding="rgb8", data=change(pictures[eye][:size]))

    return put
