# SPDX-License-Identifier: Apache-2.0
"""Renders the pictures of the cameras in a process of its own, `python -m services.robot_sim.renderer`.

Reads: clock, {part}/state, sim/truth (true poses of the objects). With optics = "dragonfly", tick is read in place of {part}/state.
Writes: vision/image/{camera}, vision/camera/{camera}; only while there are subscribers.

Pictures with optics = "dragonfly" (imperfect cameras) are published after a latency. They are drawn during this time, as soon as the true
postures are known up to the end of the exposure.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from bus_schema.messages import Camera, Clock, Image, Truth
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.rendering.scene import Picture, Scene, clutter, room
from mobee.rendering.solid import Solid
from mobee.robot.cameras import cameras_of
from mobee.robot.robot import Robot
from mobee.vision.imperfections import CameraSettings, camera_errors
from mobee.vision.tag import Tag, tag_solids
from services.common.body import Body
from services.common.rate import Percentiles
from services.common.service import Service, run_node
from services.robot_sim.config import RendererConfig
from services.robot_sim.renderer_imperfect import ImperfectCameras, Stamp


class RendererNode:
    """Follows the state of the robot and its objects on the bus, and draws the pictures of all cameras at the same posture."""

    def __init__(self, service: Service, config: RendererConfig, robot: Robot) -> None:
        self._service = service
        self._period = round(1e9 / config.frame_rate)  # ns
        self._imperfect = self._imperfect_cameras(config, robot) if config.optics == "dragonfly" else None
        if self._imperfect is None:
            self._scene = _scene(config, robot, np.zeros(6), [])
        self._body = Body(service.bus, robot)
        self._truth = service.bus.latest(Truth)
        self._images = {name: service.bus.publisher(Image, name) for name in self._scene.cameras}
        self._cameras = {name: service.bus.publisher(Camera, name) for name in self._scene.cameras}
        self._due = 0  # ns, bus clock
        self._waiting: deque[tuple[int, dict[str, Picture]]] = deque()  # imperfect pictures whose latency passes, after their time, ns
        self._will_expose = False
        self._frame_time, self._pair_time = Percentiles(), Percentiles()
        self._frame_work = Percentiles()  # without the time that others had the processor
        self._mark()
        service.mark, service.describe = self._mark, self._describe
        service.on_run(self._new_run)
        service.on_clock(self._tick)

    def _imperfect_cameras(self, config: RendererConfig, robot: Robot) -> ImperfectCameras:
        settings = CameraSettings(width=config.width, height=config.height, samples=config.samples)
        errors = camera_errors(settings, robot, list(cameras_of(robot, config.cameras)), config.seed)
        objects = config.load_world().objects.values()
        self._scene = _scene(config, robot, errors.tag, [*room(config.seed), *clutter(objects, config.seed)])
        return ImperfectCameras(
            self._service, robot, self._scene, settings, errors, config.seed, on_truth=self._expose_soon, on_encoders=self._publish_waiting
        )

    def _are_wanted(self) -> bool:
        return any(self._images[name].has_subscribers or self._cameras[name].has_subscribers for name in self._scene.cameras)

    def _tick(self, clock: Clock) -> None:
        """Draw ideal pictures that are due."""
        if self._imperfect is not None or clock.t < self._due:
            return
        if not self._are_wanted():
            self._due = clock.t + self._period
            return
        # Just after a clock message the newest states are all of the tick before it; if not, the next tick will do.
        if self._body.update() and len({state.k for state in self._body.states.values()}) == 1:
            self._due = max(self._due + self._period, clock.t)
            self._draw()

    def _draw(self) -> None:
        begin = time.perf_counter()
        q = self._body.q()
        state = next(iter(self._body.states.values()))
        truth = self._truth.take()
        if truth is not None:
            for thing in truth.objects:
                self._scene.place(thing.name, np.array(thing.position), np.array(thing.quaternion))
        self._scene.pose(q)
        for name in self._scene.cameras:
            picture = self._measured(partial(self._scene.draw, name))
            stamp: dict[str, Any] = {"k": state.k, "t": state.t, "camera": name, "k_capture": state.k}
            self._cameras[name].put(
                **stamp,
                intrinsics=self._scene.intrinsics(name).ravel().tolist(),
                distortion=[],
                exposure=0.0,
                q=q.tolist(),
                dq=self._body.dq().tolist(),
                readings=1,
            )
            height, width, _ = picture.shape
            self._images[name].put(**stamp, width=width, height=height, encoding="rgb8", data=picture.tobytes())
        self._pairs += 1
        self._pair_time.add(1e3 * (time.perf_counter() - begin))

    def _measured(self, draw: Callable[[], Picture]) -> Picture:
        start, work = time.perf_counter(), time.thread_time()
        picture = draw()
        self._frame_time.add(1e3 * (time.perf_counter() - start))
        self._frame_work.add(1e3 * (time.thread_time() - work))
        return picture

    def _expose_soon(self) -> None:
        """Schedule the drawing of imperfect pictures (`_expose`) after the messages that wait in the inbox.

        Otherwise they would be delayed, because the last drawing may have taken longer than the time between two pictures.
        """
        if not self._will_expose:
            self._will_expose = True
            self._service.inbox.put(lambda: self._service.bus.guarded("pictures", self._expose))

    def _expose(self) -> None:
        """Draw imperfect pictures that are due."""
        self._will_expose = False
        cameras = self._imperfect
        if cameras is None or cameras.exposed < self._due:
            return
        if not self._are_wanted():
            self._due = cameras.exposed + self._period
            return
        t = max(self._due, cameras.exposed - self._period)
        self._due = t + self._period
        begin = time.perf_counter()
        try:
            postures = cameras.postures(1e-9 * t)
        except InvalidValue as error:
            self._miss(error)
            return
        pictures = {name: self._measured(partial(cameras.draw, name, postures)) for name in self._scene.cameras}
        self._pair_time.add(1e3 * (time.perf_counter() - begin))
        self._waiting.append((t, pictures))
        self._publish_waiting()

    def _publish_waiting(self) -> None:
        """Publish the imperfect pictures whose latency has passed."""
        cameras = self._imperfect
        while cameras is not None and self._waiting and self._waiting[0][0] <= cameras.arrived:
            t, pictures = self._waiting.popleft()
            try:
                self._put(cameras, cameras.stamp(1e-9 * t), pictures)
            except InvalidValue as error:
                self._miss(error)

    def _miss(self, error: InvalidValue) -> None:
        self._missed += 1
        self._service.bus.reject("truth", str(error))

    def _put(self, cameras: ImperfectCameras, stamp: Stamp, pictures: dict[str, Picture]) -> None:
        lens, t = cameras.settings.lens, max(0, round(1e9 * stamp.t))
        k = t // max(1, self._service.bus.dt)
        for name, picture in pictures.items():
            common: dict[str, Any] = {"k": k, "t": t, "camera": name, "k_capture": k}
            self._cameras[name].put(
                **common,
                intrinsics=lens.matrix.ravel().tolist(),
                distortion=list(lens.distortion),
                exposure=cameras.settings.exposure,
                q=stamp.q.tolist(),
                dq=stamp.dq.tolist(),
                readings=stamp.readings,
            )
            height, width, _ = picture.shape
            self._images[name].put(**common, width=width, height=height, encoding="rgb8", data=picture.tobytes())
        self._pairs += 1

    def _new_run(self) -> None:
        self._body.forget()
        if self._imperfect is not None:
            self._imperfect.forget()
        self._waiting.clear()
        self._due = 0

    def _mark(self) -> None:
        self._pairs = self._missed = 0
        self._frame_time.clear()
        self._frame_work.clear()
        self._pair_time.clear()

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "pairs": self._pairs,
            "missed": self._missed,
            "frame_ms_p50": self._frame_time.at(50),
            "frame_ms_p99": self._frame_time.at(99),
            "frame_cpu_ms_p50": self._frame_work.at(50),
            "frame_cpu_ms_p99": self._frame_work.at(99),
            "pair_ms_p50": self._pair_time.at(50),
            "pair_ms_p99": self._pair_time.at(99),
        }
        each = f", {numbers['frame_ms_p50']:.0f} ms a picture" if self._pairs else ""
        return f"{self._pairs} pairs of pictures{each}", numbers


def _scene(config: RendererConfig, robot: Robot, mount: Array, around: list[Solid]) -> Scene:
    """Return the scene to draw: robot, world, cameras, and the tag on the palm.

    `mount`: (6,), displacement [m] and rotation vector [rad] of the true tag relative to that of the model. `around`: further solids.
    """
    worn = tag_solids(Tag(config.tag), robot, mount) if config.tag else []
    return Scene(robot, config.load_world(), cameras_of(robot, config.cameras), config.width, config.height, worn, around)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the renderer until a signal or a shutdown call."""
    run_node("services.robot_sim.renderer", RendererConfig, RendererNode, argv)


if __name__ == "__main__":
    main()
