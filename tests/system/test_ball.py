# SPDX-License-Identifier: Apache-2.0
"""The locator in the running system: the ball is moved to ten places."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import zenoh

from bus_schema import decode, keys
from bus_schema.messages import Camera, Image, WorldObject
from bus_schema.rpc import Done, Empty, Place, World
from mobee import load_robot
from mobee.robot.cameras import cameras_of
from services.common import rpc
from services.common.cameras import frame_at_capture
from tests.services.vision.test_locator import share_seen
from tests.system.live import running

ROBOT = load_robot("icub")
EYES = cameras_of(ROBOT)
SCENARIO = Path(__file__).with_name("ball.toml")
LOOK = 0.5  # s at each place: five pairs of pictures
LATE = 0.3  # s for the last result to come
SETTLED = 0.8  # s until pictures show the new place, and it counts

pytestmark = pytest.mark.system
pytest.importorskip("pybullet")


class Listener:
    """Pictures, cameras and places as they come."""

    def __init__(self, session: zenoh.Session) -> None:
        self.images: dict[tuple[str, int], Image] = {}
        self.cameras: dict[tuple[str, int], Camera] = {}
        self.places: dict[int, WorldObject] = {}
        self._kept = [session.declare_subscriber(WorldObject.stream.key("ball"), self._note_ball)]
        for eye in EYES:
            self._kept.append(session.declare_subscriber(Image.stream.key(eye), self._note_image))
            self._kept.append(session.declare_subscriber(Camera.stream.key(eye), self._note_camera))

    def _note_ball(self, sample: zenoh.Sample) -> None:
        ball = decode(WorldObject, sample.payload.to_bytes(), str(sample.encoding))
        self.places[ball.t_capture] = ball

    def _note_image(self, sample: zenoh.Sample) -> None:
        image = decode(Image, sample.payload.to_bytes(), str(sample.encoding))
        self.images[image.camera, image.t] = image

    def _note_camera(self, sample: zenoh.Sample) -> None:
        camera = decode(Camera, sample.payload.to_bytes(), str(sample.encoding))
        self.cameras[camera.camera, camera.t] = camera

    def errors(self, since: int, until: int, at: np.ndarray) -> list[float]:
        """How far off [m] the ball was placed in each pair of pictures that shows 90 % of it; infinity where it was not found."""
        found = []
        for t in sorted({t for _, t in self.cameras if since < t <= until}):
            if all((eye, t) in shelf for eye in EYES for shelf in (self.images, self.cameras)) and self._visible(t, at):
                ball = self.places.get(t)
                found.append(np.inf if ball is None else float(np.linalg.norm(np.array(ball.position) - at)))
        return found

    def _visible(self, t: int, at: np.ndarray) -> bool:
        return all(self._share(eye, t, at) >= 0.9 for eye in EYES)

    def _share(self, eye: str, t: int, at: np.ndarray) -> float:
        image, camera = self.images[eye, t], self.cameras[eye, t]
        picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
        frame = frame_at_capture(ROBOT, EYES[eye], np.array(camera.q))
        return share_seen(picture, frame, at, np.array(camera.intrinsics).reshape(3, 3))


def test_the_ball_is_located_at_ten_places_and_put_into_the_model_s_world(tmp_path: Path, rng: np.random.Generator) -> None:
    looks: list[tuple[int, int, np.ndarray]] = []
    with running(tmp_path, str(SCENARIO)) as (_, watcher):
        listener = Listener(watcher.session)
        time.sleep(3.0)  # head and torso reach their posture
        for _ in range(10):
            at = np.array([rng.uniform(-0.44, -0.3), rng.uniform(-0.1, 0.1), -0.07])
            rpc.call(watcher.session, "test", keys.sim("place"), Place, Done, timeout=5.0, name="ball", position=at.tolist())
            time.sleep(SETTLED)
            since = watcher.clock.t
            time.sleep(LOOK)
            looks.append((since, watcher.clock.t, at))
        time.sleep(LATE)
        known = rpc.call(watcher.session, "test", keys.world_rpc("list"), Empty, World, timeout=2.0)
    errors = [error for look in looks for error in listener.errors(*look)]
    assert len(errors) >= 40  # 10 Hz, 5 s, not always in view
    median, worst = np.median(errors), np.quantile(errors, 0.95, method="higher")
    print(f"ball: {len(errors)} frames, median {1e3 * median:.2f} mm, 95 % {1e3 * worst:.2f} mm")
    assert median < 0.01
    assert worst < 0.02
    (ball,) = (thing for thing in known.objects if thing.name == "ball")
    np.testing.assert_allclose(ball.position, at, atol=0.02)
    assert ball.role == "target"
