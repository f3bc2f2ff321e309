# SPDX-License-Identifier: Apache-2.0
"""Runs the monitor: the newest message of every stream, twenty times a second, to a page and a file."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import rerun as rr

from bus_schema import keys
from bus_schema.messages import Clock, ContactItem, Contacts, Event, Forces, Image, Learned, Motion, Transition, WorldObject
from bus_schema.rpc import World
from mobee.rendering.palette import colors_of
from mobee.robot.robot import Robot
from services.common.body import Body
from services.common.exit_codes import FAILED
from services.common.rate import Percentiles, Rate
from services.common.rpc import CallFailed
from services.common.service import Service
from services.monitor.blueprint import TIMELINE
from services.monitor.config import Config
from services.monitor.learning import Learning
from services.monitor.output import Output
from services.monitor.plots import Plots
from services.monitor.scene import Poses, Scene

WORLD_PERIOD = 1.0  # s between two requests for the model's world
JPEG_QUALITY = 85
LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class MonitorNode:
    """Shows the newest messages at its own rate; those between are not shown."""

    def __init__(self, service: Service, config: Config, robot: Robot, output: Output) -> None:
        self._service, self._output, self._stream = service, output, output.stream
        bus = service.bus
        self._body = Body(bus, robot)
        self._motions = {part: bus.latest(Motion, part) for part in colors_of(robot.parts)}
        self._forces = [bus.latest(Forces, source) for source in ("model", "controller")]
        self._contacts = bus.latest(Contacts)
        self._images = {eye: bus.latest(Image, eye) for eye in keys.EYES}
        self._touching: list[ContactItem] = []
        self._offset = self._last = 0.0  # s: runs are shown one after the other
        self._time = Percentiles()
        self._mark()
        self._set_time()
        self._scene, self._plots = Scene(self._stream, robot), Plots(self._stream, robot)
        self._learning, self._poses = Learning(self._stream, robot), Poses(self._stream, robot)
        service.mark, service.describe = self._mark, self._describe
        service.on_run(self._new_run)
        service.on_clock(self._note_clock)
        service.on_alive(self._note_alive)
        service.on_each(WorldObject, self._show_object)
        service.on_each(Transition, self._show_transition)
        service.on_each(Learned, self._show_learned, history=True)
        service.on_each(Event, self._show_event, history=True, any_run=True)
        self._rate, self._image_rate, self._world_rate = Rate(1.0 / config.rate), Rate(1.0 / config.image_rate), Rate(WORLD_PERIOD)
        for rate, look in ((self._rate, self._show_robot), (self._image_rate, self._show_images), (self._world_rate, self._ask_world)):
            self._repeat(rate, look)

    def _repeat(self, rate: Rate, look: Callable[[], None]) -> None:
        def turn() -> None:
            look()
            self._service.inbox.at(rate.next(), turn)

        self._service.inbox.at(rate.next(), turn)

    def _show_robot(self) -> None:
        """Show robot, contacts and plots."""
        begin = time.perf_counter()
        self._check_page()
        self._set_time()
        contacts = self._contacts.take()
        if contacts is not None:
            self._touching = contacts.contacts
        if self._body.update():
            self._scene.log_robot(self._body.q(), self._touching)
        for part, stream in self._motions.items():
            motion = stream.take()
            if motion is not None:
                self._plots.log_motion(part, motion)
        for said in self._forces:
            forces = said.take()
            if forces is not None:
                self._plots.log_forces(forces)
        self._looks += 1
        self._time.add(1e3 * (time.perf_counter() - begin))

    def _show_images(self) -> None:
        """Show the newest pictures of the eyes."""
        for eye, stream in self._images.items():
            image = stream.take()
            if image is not None and len(image.data) == image.width * image.height * 3:
                pixels = np.frombuffer(image.data, dtype=np.uint8).reshape(image.height, image.width, 3)
                self._stream.log(f"eyes/{eye}", rr.Image(pixels).compress(jpeg_quality=JPEG_QUALITY))

    def _ask_world(self) -> None:
        if self._service.alive.get("model"):
            self._service.ask(keys.world_rpc("list"), World, self._note_world)

    def _note_world(self, answer: World | CallFailed) -> None:
        if isinstance(answer, World):
            self._scene.set_objects(answer.objects)

    def _show_object(self, seen: WorldObject) -> None:
        self._scene.log_object(seen)

    def _show_transition(self, seen: Transition) -> None:
        part = seen.agent.removeprefix("agent_")
        if part in self._motions:
            self._plots.log_transition(part, seen)
            self._learning.log_step(part, seen)
            if self._body.update():
                self._poses.note(self._body.q())
            self._transitions += 1

    def _show_learned(self, learned: Learned) -> None:
        if learned.agent in self._motions:
            self._learning.log(learned.agent, learned)

    def _show_event(self, event: Event) -> None:
        self._stream.log("events", rr.TextLog(f"{event.src}: {event.text}", level=LEVELS[event.level]))

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        self._stream.log("events", rr.TextLog(f"{who} {'is up' if up else 'is gone'}", level="INFO" if up else "WARN"))

    def _note_clock(self, clock: Clock) -> None:
        self._last = max(self._last, self._offset + 1e-9 * clock.t)

    def _new_run(self) -> None:
        self._offset = self._last
        self._body.forget()
        self._scene.forget()

    def _set_time(self) -> None:
        self._stream.set_time(TIMELINE, duration=self._last)

    def _check_page(self) -> None:
        page = self._output.page
        if page is not None and page.poll() is not None:
            self._service.log.error(
                "the server of the page ended with code %s: the monitor ends too, and is started again", page.returncode
            )
            raise SystemExit(FAILED)

    def _mark(self) -> None:
        self._looks = self._transitions = 0
        self._time.clear()

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "looks": self._looks,
            "missed": self._rate.missed,
            "transitions": self._transitions,
            "look_ms_p50": self._time.at(50),
            "look_ms_p99": self._time.at(99),
        }
        return self._output.url or "recording only", numbers
