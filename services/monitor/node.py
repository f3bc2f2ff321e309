# SPDX-License-Identifier: Apache-2.0
"""Runs the monitor: shows the messages of other services on its web page, the robot up to 20 times per second, and records them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from bus_schema import keys
from bus_schema.messages import (
    Clock,
    ContactItem,
    Contacts,
    Decision,
    EStop,
    Event,
    Forces,
    Image,
    Learned,
    Motion,
    Playback,
    Reach,
    Transition,
    WorldObject,
)
from bus_schema.rpc import World
from mobee.errors import InvalidValue
from mobee.rendering.palette import colors_of_all
from mobee.robot.motor_units import slides
from mobee.robot.robot import Robot
from services.common.body import Body
from services.common.rate import Percentiles, Rate
from services.common.rpc import CallFailed
from services.common.service import Service, return_free_memory
from services.common.worlds import AT_TABLE, require_sizes
from services.monitor.config import Config
from services.monitor.controls import Known, PageControls
from services.monitor.status import STALE, Seen, banner
from services.monitor.story.sentences import STRATEGIES
from services.monitor.story.teller import Teller
from services.monitor.story.words import joint_words, title_of
from services.monitor.viewer.blueprint import TIMELINE, shown_of
from services.monitor.viewer.learning import Learning
from services.monitor.viewer.output import Output
from services.monitor.viewer.plots import Plots
from services.monitor.viewer.scene import Poses, Scene
from services.monitor.web.body import body_at, contacts_of, shapes_of, thing
from services.monitor.web.record import SHOWN_EVENTS

WORLD_PERIOD = 1.0  # s between two requests for the model's world
BODY_PERIOD = 0.1  # s between two poses of the page's own picture of the body
STORY_PERIOD = 0.25  # s between two updates of the story and the state
RECORD_PERIOD = 0.2  # s between two poses in the record of the page
TRIM_PERIOD = 60.0  # s; messages that wait while the processor is busy leave free memory in the heaps of Zenoh's threads
STOP_REPEATED = 2.0  # s after the last message of an emergency stop, which robot_sim repeats, for which it counts as set
JPEG_QUALITY = 85
LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class MonitorNode:
    """Shows the messages of other services on the monitor's web page, and writes them to the folder of the run if there is one.

    Of motions, reaches, forces, contacts and images it shows only the newest message, at fixed rates. It shows all events and transitions.
    """

    def __init__(self, service: Service, config: Config, robot: Robot, output: Output) -> None:
        self._service, self._output, self._robot = service, output, robot
        self._stream, self._board = output.frames, output.board
        self._colors = colors_of_all(robot.parts)
        bus = service.bus
        self._body = Body(bus, robot)
        self._motions = {part: bus.latest(Motion, part) for part in robot.parts}
        self._reaches = {part: bus.latest(Reach, part) for part in robot.parts}
        self._forces = [bus.latest(Forces, source) for source in ("model", "controller")]
        self._contacts = bus.latest(Contacts)
        self._images = {name: bus.latest(Image, name) for name in config.cameras_on(robot)}
        self._touching: list[ContactItem] = []
        self._recorded: list[dict[str, Any]] = []  # contacts
        self._has_trouble = False  # the record of the page cannot be written
        self._offset = self._last = 0.0  # s: runs are shown one after the other
        self._time = Percentiles()
        self._teller, self._known = Teller(robot, self._colors), Known()
        self._seen = Seen(patience=STALE + (config.patience if service.locked else 0.0))
        self._ticked: float | None = None  # monotonic clock
        self._stop: tuple[float, EStop] | None = None  # with the monotonic clock of the newest
        self._newest = -1  # tick of the newest state of a part
        self._held_since: dict[str, float] = {}  # monotonic clock
        self._why_held: dict[str, str] = {}
        self._events: deque[dict[str, Any]] = deque(maxlen=SHOWN_EVENTS)
        self._mark()
        self._set_time()
        self._scene, self._plots = Scene(self._stream, robot), Plots(self._stream, robot)
        self._learning, self._poses = Learning(self._stream, robot), Poses(self._stream, robot)
        self._board.put("robot", self._described())
        output.controls.real = PageControls(service, robot, self._known, self._board, self._scene.show_fields)
        self._subscribe()
        self._rate = Rate(1.0 / config.rate)
        self._repeat(self._rate, self._show_robot)
        for period, show in (
            (1.0 / config.image_rate, self._show_images),
            (WORLD_PERIOD, self._ask_world),
            (BODY_PERIOD, self._show_body),
            (STORY_PERIOD, self._show_story),
            (RECORD_PERIOD, self._record_pose),
            (TRIM_PERIOD, return_free_memory),
        ):
            self._repeat(Rate(period), show)

    def _subscribe(self) -> None:
        service = self._service
        service.mark, service.describe = self._mark, self._describe
        service.on_run(self._new_run)
        service.on_clock(self._note_clock)
        service.on_alive(self._note_alive)
        service.on_each(WorldObject, self._show_object)
        service.on_each(Decision, self._teller.note_decision, history=True)
        service.on_each(Transition, self._show_transition)
        service.on_each(Learned, self._show_learned, history=True)
        service.on_each(Playback, self._teller.note_playback, history=True)
        service.on_each(Event, self._show_event, history=True, any_run=True)
        service.on_each(EStop, self._note_stop, any_run=True)

    def _described(self) -> dict[str, Any]:
        """Return the constant data of the robot, which the page needs once."""
        robot = self._robot
        parts = [
            {
                "name": name,
                "title": title_of(name),
                "color": list(self._colors[name]),
                "motors": [
                    {"name": joint_words(motor.name, name, robot), "low": float(low), "high": float(high), "slides": slides(robot, motor)}
                    for motor, (low, high) in zip(robot.motor_table[part.slice], robot.limits[part.slice], strict=True)
                ],
            }
            for name, part in robot.parts.items()
        ]
        shown = shown_of(robot)
        return {
            "name": robot.name,
            "parts": parts,
            "shapes": shapes_of(robot, self._colors),
            "eye": shown.eye.tolist(),
            "target": shown.target.tolist(),
            "explorers": STRATEGIES,
            "icub": robot.name in AT_TABLE,
            "lockstep": self._service.locked,
            "monitor": self._service.instance,
        }

    def _repeat(self, rate: Rate, show: Callable[[], None]) -> None:
        def turn() -> None:
            show()
            self._service.inbox.at(rate.next(), turn)

        self._service.inbox.at(rate.next(), turn)

    # Data that are shown regularly

    def _show_robot(self) -> None:
        """Show robot, contacts and plots in the 3D view."""
        begin = time.perf_counter()
        self._set_time()
        self._take_states()
        moved = self._body.update()
        if self._stream.begin_update():
            self._log_update(moved)
        self._stream.end_update()
        self._updates += 1
        self._time.add(1e3 * (time.perf_counter() - begin))

    def _log_update(self, moved: bool) -> None:
        if moved:
            self._scene.log_robot(self._body.q(), self._touching)
        for part, motion in self._known.motions.items():
            self._plots.log_motion(part, motion)
        for said in self._forces:
            forces = said.take()
            if forces is not None:
                self._plots.log_forces(forces)

    def _take_states(self) -> None:
        contacts = self._contacts.take()
        if contacts is not None:
            self._touching = contacts.contacts
        for part, stream in self._motions.items():
            motion = stream.take()
            if motion is not None:
                self._known.motions[part] = motion
        for part, reaching in self._reaches.items():
            reach = reaching.take()
            if reach is not None:
                self._known.reaches[part] = reach
                self._teller.note_reach(part, reach)
        self._known.gates = {part: state.gate for part, state in self._body.states.items()}
        if self._known.gates and set(self._known.gates.values()) == {"estop"}:
            self._known.stopped = time.monotonic()
        newest = max((state.k for state in self._body.states.values()), default=-1)
        if newest != self._newest:
            self._newest, self._known.heard = newest, time.monotonic()

    def _show_body(self) -> None:
        server = self._output.server
        if server is not None and server.site.pages.open() and len(self._body.states) == len(self._robot.parts):
            q = self._body.q()
            shown = body_at(self._robot, q, self._touching)
            self._board.put("body", {"t": round(self._last, 3), "q": np.round(q, 4).tolist(), **shown})

    def _record_pose(self) -> None:
        if self._output.record is not None and len(self._body.states) == len(self._robot.parts):
            q = self._body.q()
            self._board.record("q", np.round(q, 4).tolist())
            contacts = contacts_of(self._touching)
            if contacts != self._recorded:
                self._recorded = contacts
                self._board.record("contacts", contacts)

    def _show_story(self) -> None:
        for name, value in self._teller.values().items():
            self._board.put(name, value)
        self._board.put("status", self._status())
        if self._output.record is not None:
            self._output.record.flush()
            self._report(self._output.record.trouble)

    def _report(self, trouble: str) -> None:
        """Publish an event when the record of the page begins or ceases to lose values; `trouble`: the reason, empty if it loses none."""
        if bool(trouble) != self._has_trouble:
            level, text = ("warning", f"nothing of the page is recorded: {trouble}") if trouble else ("info", "the page is recorded again")
            self._service.bus.event(level, "recording", text)
        self._has_trouble = bool(trouble)

    def _status(self) -> dict[str, Any]:
        now, seen = time.monotonic(), self._seen
        seen.clock_age = None if self._ticked is None else now - self._ticked
        seen.gates, seen.why_held = self._known.gates, self._why_held
        seen.services = {name for name, instances in self._service.alive.items() if instances}
        seen.known = {*seen.known, *seen.services}
        held = {part for part, motion in self._known.motions.items() if motion.status in ("held", "suspended")}
        self._held_since = {part: self._held_since.get(part, now) for part in held}
        seen.held_for = {part: now - since for part, since in self._held_since.items()}
        seen.stop = None if self._stop is None or now - self._stop[0] > STOP_REPEATED else self._stop[1]
        said = banner(seen)
        return {
            "banner": said,
            "mode": seen.mode,
            "time": round(self._last, 1),
            "agents": sorted(title_of(name.removeprefix("agent_")) for name in seen.services if name.startswith("agent_")),
            "services": sorted(seen.services),
            "moving": [title_of(part) for part, motion in self._known.motions.items() if motion.status == "moving"],
        }

    def _show_images(self) -> None:
        """Show the newest pictures of the cameras."""
        for name, stream in self._images.items():
            image = stream.take()
            if image is not None and len(image.data) == image.width * image.height * 3:
                pixels = np.frombuffer(image.data, dtype=np.uint8).reshape(image.height, image.width, 3)
                self._stream.log(f"eyes/{name}", rr.Image(pixels).compress(jpeg_quality=JPEG_QUALITY))

    def _ask_world(self) -> None:
        if self._service.alive.get("model"):
            self._service.ask(keys.world_rpc("list"), World, self._note_world)

    def _note_world(self, answer: World | CallFailed) -> None:
        if isinstance(answer, World):
            self._scene.set_objects(answer.objects)
            self._known.objects = {one.name: one for one in answer.objects}
            self._show_things()

    def _show_things(self) -> None:
        self._board.put("objects", [thing(one) for one in self._known.objects.values()])

    # Events that are shown at once

    def _show_object(self, seen: WorldObject) -> None:
        try:
            require_sizes(seen.geometry)
        except InvalidValue as error:
            self._service.bus.reject("world", f"{seen.name}: {error}")
            return
        if seen.valid_until >= self._service.bus.t:  # else it was withdrawn, and the model's list ends it
            self._scene.log_object(seen)

    def _show_transition(self, seen: Transition) -> None:
        part = seen.agent
        if part not in self._robot.parts:
            return
        self._teller.note_transition(seen)
        self._plots.log_transition(part, seen)
        self._learning.log_step(part, seen)
        if self._body.update():
            self._poses.note(self._body.q())
        self._transitions += 1

    def _show_learned(self, learned: Learned) -> None:
        if learned.agent in self._robot.parts:
            self._teller.note_learned(learned)
            self._learning.log(learned.agent, learned)

    def _show_event(self, event: Event) -> None:
        if event.code in ("held", "suspended"):
            what, _, why = event.text.partition(": ")
            self._why_held[what.split(" ")[0]] = why
        self._stream.log("events", rr.TextLog(f"{event.src}: {event.text}", level=LEVELS[event.level]))
        self._tell(event.level, event.src, event.text)

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        self._stream.log("events", rr.TextLog(f"{who} {'is up' if up else 'is gone'}", level="INFO" if up else "WARN"))
        self._tell("info" if up else "warning", who, "is up" if up else "is gone")
        if not up:
            self._teller.note_gone(who)

    def _tell(self, level: str, who: str, text: str) -> None:
        event = {"t": round(self._last, 1), "level": level, "who": who, "text": text[:300]}
        self._events.append(event)
        self._board.record("event", event)
        self._board.put("events", list(self._events))

    def _note_stop(self, stop: EStop) -> None:
        self._stop = (time.monotonic(), stop) if stop.set else None
        if stop.set and stop.src == "robot_sim":
            self._known.confirmed = time.monotonic()

    def _note_clock(self, clock: Clock) -> None:
        self._last = max(self._last, self._offset + 1e-9 * clock.t)
        self._ticked, self._seen.mode = time.monotonic(), clock.mode

    def _new_run(self) -> None:
        self._offset = self._last
        self._body.forget()
        self._scene.forget()
        self._teller.forget_run()

    def end(self) -> None:
        """Give all parts that pages have taken back to their agents, and show on the open pages that the system has ended."""
        controls = self._output.controls.real
        if isinstance(controls, PageControls):
            controls.give_all_back()
        self._seen.ended = True
        self._board.put("status", self._status())

    @property
    def now(self) -> float:
        """The robot's time [s] since the begin of the first run that this monitor has seen.

        It never decreases: a later run begins at the time that the previous run has reached.
        """
        return self._last

    def _set_time(self) -> None:
        self._stream.set_time(TIMELINE, self._last)

    def _mark(self) -> None:
        self._updates = self._transitions = 0
        self._time.clear()

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "updates": self._updates,
            "missed": self._rate.missed,
            "transitions": self._transitions,
            "update_ms_p50": self._time.at(50),
            "update_ms_p99": self._time.at(99),
        }
        server = self._output.server
        if server is not None:
            numbers["pages"] = len(server.site.pages.open())
        return self._output.url or "recording only", numbers
