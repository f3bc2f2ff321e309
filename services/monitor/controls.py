# SPDX-License-Identifier: Apache-2.0
"""Executes the commands of the monitor's web pages by calls on the bus. At any time at most one page holds the controls."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from threading import RLock
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import EStop, Geometry, Motion, Reach
from bus_schema.rpc import (
    AddObject,
    Done,
    Empty,
    Explore,
    Goal,
    MoveObject,
    ObjectState,
    OneName,
    Pace,
    Place,
    ReachFor,
    Reply,
    Request,
    Started,
    Take,
    Taken,
    WithEpoch,
)
from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.reach import TARGET
from mobee.robot.robot import Robot
from services.common.emergency_stop import SILENCE, StopRecord, StopSender
from services.common.hands import hand_for, hand_of, part_of, require_apart
from services.common.reach_client import inner_radius
from services.common.rpc import CallFailed
from services.common.service import Service
from services.monitor.story.sentences import STRATEGIES
from services.monitor.story.words import listed, title_of
from services.monitor.web.board import Board
from services.monitor.web.server import Refused

TRIES = 3
FREE_PATIENCE = 4.0  # s until a part that was taken can move
STOP_PATIENCE, STOP_PERIOD = 2.0, 0.1  # s for which an emergency stop is repeated until all parts report it
STOP_CHECK = 0.01  # s between two checks for that report
AFTER_REACH = 4.0  # s for which the hand stays after a reach, before the part is given back
PLACE_RADIUS = 0.03  # m, of the sphere that is presented at a place
UPRIGHT = [1.0, 0.0, 0.0, 0.0]
FARTHEST = 3.0  # m: a place farther from the origin is a mistake


@dataclass
class Known:
    """The newest messages that the commands of the monitor's web page depend on. The main thread writes them; other threads read them.

    `gates`: state of robot_sim's safety gate (check of commands), by part. `stopped`: monotonic time [s] at which all parts last reported
    an emergency stop; `confirmed`: at which robot_sim last reported it; `heard`: at which the newest state of a part came. `motions`,
    `reaches`: the newest message, by part. `objects`: objects of the world of the service `model`, by name.
    """

    gates: dict[str, str] = field(default_factory=dict)
    stopped: float = 0.0
    confirmed: float = 0.0
    heard: float = 0.0
    motions: dict[str, Motion] = field(default_factory=dict)
    reaches: dict[str, Reach] = field(default_factory=dict)
    objects: dict[str, ObjectState] = field(default_factory=dict)


@dataclass
class _Taken:
    epoch: int
    agent: str  # that rests meanwhile; empty: none
    reach: str = ""  # id of a reach after which the part is given back
    over_since: float | None = None  # monotonic clock: the reach has ended


class PageControls:
    """Executes the commands of all open web pages of the monitor.

    The threads of the web server call its methods. It executes one command at a time; only "stop" does not wait for other commands. A
    method returns when the other services have answered.
    """

    def __init__(self, service: Service, robot: Robot, known: Known, board: Board, show_fields: Callable[[bool], None]) -> None:
        """Create the controls.

        `known`: newest messages of other services. `board`: values of the page. `show_fields(shown)` shows or hides the robot's fields in
        the 3D view; it is called in the service's main thread.
        """
        self._service, self._robot, self._known, self._board = service, robot, known, board
        self._show_fields = show_fields
        self._lock = RLock()
        self._holder, self._pages = "", 0
        self._taken: dict[str, _Taken] = {}
        self._presented = ""  # part for which this service presents a target of its own
        self._released = 0.0  # s, monotonic clock: when a page last released an emergency stop
        self._estop = service.bus.publisher(EStop)
        self._verbs: Mapping[str, Callable[[dict[str, Any]], str]] = {
            "release": self._release_stop,
            "pause": lambda given: self._plain(keys.sim("pause"), "Paused."),
            "resume": lambda given: self._plain(keys.sim("resume"), "The robot continues."),
            "reset": lambda given: self._reset(),
            "pace": self._pace,
            "fields": self._fields,
            "explore": self._explore,
            "take": self._take_over,
            "give": self._give_back,
            "goal": self._goal,
            "reach": self._reach,
            "place": self._place,
        }
        self._publish()

    def do(self, page: str, verb: str, arguments: dict[str, Any]) -> str:
        """Execute a command of a page and return a sentence for the user. Raises Refused if the command cannot be executed.

        `page`: id of the page. `verb`: name of the command, such as "stop", "pause" or "goal". `arguments`: its values, by name.
        """
        if verb == "stop":  # from every page, and without waiting for another call
            return self._stop()
        with self._lock:
            if verb == "control":
                self._holder = page
                self._publish()
                return "This page holds the controls."
            if verb not in self._verbs:
                raise Refused(f"the page cannot {verb!r}; valid: control, stop, {', '.join(self._verbs)}")
            if self._holder not in ("", page):
                raise Refused("another page holds the controls: press C to take them")
            self._holder = page
            try:
                done = self._verbs[verb](arguments)
            except CallFailed as failed:
                raise Refused(str(failed)) from None
            except (MobeeError, KeyError, TypeError, ValueError) as error:
                raise Refused(f"{verb}: {error}") from None
            finally:
                self._publish()
            return done

    def tend(self, open_pages: set[str]) -> None:
        """Give parts back to their agents if the page no longer needs them; called once per second.

        If the page that has the controls is not among `open_pages` (ids), all its parts are given back. If the page requested a motion of
        a hand to a target (a reach), the part is given back 4 s after the end of this motion. If another client has taken a part from the
        page, or the controller was started again, the page gives the part up, and the part's agent is asked to resume.
        """
        with self._lock:
            self._pages = len(open_pages)
            if self._holder and self._holder not in open_pages:
                self._holder = ""
                self.give_all_back()
            for part in [part for part, taken in self._taken.items() if self._is_done(part, taken)]:
                self._give(part)
            self._publish()

    def give_all_back(self) -> None:
        """Return the control of all parts from the pages to the agents."""
        with self._lock:
            for part in list(self._taken):
                self._give(part)

    def _publish(self) -> None:
        self._board.put("control", {"holder": self._holder, "pages": self._pages, "taken": sorted(self._taken)})

    def _call(self, key: str, request: type[Request], reply: type[Reply], **fields: Any) -> Any:
        return self._service.call(key, request, reply, tries=TRIES, **fields)

    def _plain(self, key: str, said: str) -> str:
        self._call(key, Empty, Done)
        return said

    # The whole robot

    def _stop(self) -> str:
        begin = repeat = time.monotonic()
        source, reason, endpoint = "page", "pressed on the page", self._service.config.endpoint
        with suppress(OSError):  # datagrams and the bus remain
            StopRecord.of_endpoint(endpoint).stop(source, reason)
        with StopSender(endpoint, source, reason) as sender:
            while (now := time.monotonic()) < begin + STOP_PATIENCE:
                if now >= repeat:
                    sender.send()
                    self._estop.put(set=True, source=source, reason=reason)
                    repeat = now + STOP_PERIOD
                time.sleep(STOP_CHECK)
                if self._known.stopped > begin:  # never again after that: a release may follow at once
                    return "Stopped: all motors."
                if (sender.is_confirmed() or self._known.confirmed > begin) and now > max(begin, self._known.heard) + SILENCE:
                    return "Stopped: all motors, as robot_sim confirms."
                if self._released > begin:
                    raise Refused("a page released the robot before all parts confirmed the stop: press S to stop it again")
        raise Refused(f"the stop was sent for {STOP_PATIENCE:g} s, and not every part confirms it: use the robot's own emergency button")

    def _release_stop(self, given: dict[str, Any]) -> str:
        self._released = time.monotonic()
        return self._plain(keys.ESTOP_RESET, "Released: the controller arms the parts, and agents continue.")

    def _reset(self) -> str:
        self.give_all_back()
        return self._plain(keys.sim("reset"), "The simulation starts again at home, as a new run.")

    def _pace(self, given: dict[str, Any]) -> str:
        speed = float(given["speed"])
        self._call(keys.sim("pace"), Pace, Done, speed=speed)
        return f"At most {speed:g} times real time." if speed > 0.0 else "As fast as the processes answer."

    def _fields(self, given: dict[str, Any]) -> str:
        shown = bool(given["shown"])
        self._service.inbox.put(lambda: self._show_fields(shown))
        return "The fields are shown." if shown else "The fields are hidden."

    def _explore(self, given: dict[str, Any]) -> str:
        """Change the explorer of the agent of a part, or of all agents."""
        explorer = str(given["explorer"])
        alive = self._service.alive.copy()  # the main thread changes it
        running = [name for name, instances in alive.items() if instances and name.startswith("agent_")]
        agents = [f"agent_{self._part(given)}"] if given.get("part") else running
        if not agents:
            raise Refused("no agent runs")
        for agent in agents:
            if not self._service.alive.get(agent):
                raise Refused(f"{agent} does not run")
            self._call(keys.service_rpc(agent, "explore"), Explore, Done, explorer=explorer)
        whose = listed([title_of(agent.removeprefix("agent_")) for agent in sorted(agents)])
        return f"From the next action on the {whose} explore{'s' if len(agents) == 1 else ''} {STRATEGIES.get(explorer, f'by {explorer}')}."

    # Parts

    def _take_over(self, given: dict[str, Any]) -> str:
        part = self._part(given)
        self._take(part)
        return f"The {title_of(part)} is yours: move its sliders, G gives it back."

    def _give_back(self, given: dict[str, Any]) -> str:
        part = self._part(given)
        self._give(part)
        return f"The {title_of(part)} was given back."

    def _goal(self, given: dict[str, Any]) -> str:
        part = self._part(given)
        limits = self._robot.limits[self._robot.part(part).slice]
        q = np.clip(np.array(given["q"], dtype=np.float64), *limits.T)
        self._take(part).reach = ""
        self._aim(part, "goal", Goal, q=q.tolist())
        return f"The {title_of(part)} moves."

    def _reach(self, given: dict[str, Any]) -> str:
        name, radius, link = given.get("object"), PLACE_RADIUS, ""
        place = _place_of(given["position"]) if "position" in given else None
        if name is not None:
            found = self._known.objects.get(str(name))
            if found is None:
                known = ", ".join(self._known.objects) or "none"
                raise Refused(f"the model knows no {name}, only {known}: vision must see it. Click a place instead, then H")
            if found.role != "target":
                raise Refused(f"{name} has the role {found.role}; hands reach for targets only. Click a place instead")
            place, radius, link = np.array(found.position), inner_radius(found), found.link
        if place is None:
            raise Refused("click a place, or name an object")
        hand = hand_for(self._robot, place) if not given.get("part") else hand_of(self._robot, self._part(given))
        part = part_of(self._robot, hand)
        require_apart(self._robot, part, hand, str(name), link)
        before = self._taken.get(part)
        taken = self._take(part)
        asked = {"marker": hand, "object": name or TARGET, "position": place.tolist(), "radius": radius, "aim": "surface", "stay": True}
        try:
            if name is None:
                self._add_target(place)
                self._presented = part
            taken.reach, taken.over_since = self._aim(part, "reach", ReachFor, **asked), None
        except CallFailed:
            if taken is not before:  # it was taken for this reach
                self._give(part)
            raise
        return f"The {title_of(hand)} reaches for {'it' if name is None else f'the {name}'}."

    def _add_target(self, place: Array) -> None:
        """Put a target into the model's world; raises CallFailed if another service presents one, which an agent that rests does not."""
        sphere, key = Geometry(kind="sphere", size=[PLACE_RADIUS]), keys.world_rpc("add")
        position = place.tolist()
        self._call(key, AddObject, Done, name=TARGET, geometry=sphere, position=position, quaternion=UPRIGHT, role="target")

    def _remove_target(self) -> None:
        with suppress(CallFailed):  # removed already
            self._call(keys.world_rpc("remove"), OneName, Done, name=TARGET)

    def _place(self, given: dict[str, Any]) -> str:
        """Move an object of the simulator; an object that vision does not perceive is also moved in the model's world."""
        name, place = str(given["name"]), _place_of(given["position"])
        self._call(keys.sim("place"), Place, Done, name=name, position=place.tolist())
        if not self._service.alive.get("vision"):
            self._call(keys.world_rpc("move"), MoveObject, Done, name=name, position=place.tolist())
        return f"The {name} was put there."

    def _part(self, given: dict[str, Any]) -> str:
        return self._robot.part(str(given["part"])).name

    def _take(self, part: str) -> _Taken:
        """Own the goal of a part; its agent rests until the part is given back."""
        motion = self._known.motions.get(part)
        taken = self._taken.get(part)
        if taken is not None and motion is not None and motion.epoch == taken.epoch:
            return taken
        agent = f"agent_{part}"
        if not self._service.alive.get(agent):
            agent = ""
        else:
            try:
                self._call(keys.service_rpc(agent, "rest"), Empty, Done)
            except CallFailed as failed:
                raise Refused(f"the {title_of(part)} belongs to {agent}, which does not answer the call to rest ({failed})") from None
        try:
            epoch = self._call(keys.goal(part, "take"), Take, Taken, instance=self._service.instance).epoch
        except CallFailed:
            self._wake(agent)
            raise
        self._taken[part] = taken = _Taken(epoch, agent)
        give_up = time.monotonic() + FREE_PATIENCE
        while not self._is_free(part, epoch):
            if time.monotonic() > give_up:
                self._give(part)
                raise Refused(f"the {title_of(part)} is in hold: wait until it is armed again, or release the emergency stop")
            time.sleep(0.02)
        return taken

    def _is_free(self, part: str, epoch: int) -> bool:
        motion = self._known.motions.get(part)
        return motion is not None and motion.epoch == epoch and motion.status != "held"

    def _give(self, part: str) -> None:
        taken = self._taken.pop(part, None)
        if taken is None:
            return
        with suppress(CallFailed):  # lost already, or there is no controller
            self._call(keys.goal(part, "release"), WithEpoch, Done, epoch=taken.epoch)
        if part == self._presented:
            self._remove_target()
            self._presented = ""
        self._wake(taken.agent)

    def _wake(self, agent: str) -> None:
        if agent:
            with suppress(CallFailed):  # it has ended meanwhile: a new one acts from its start
                self._call(keys.service_rpc(agent, "resume"), Empty, Done)

    def _aim(self, part: str, verb: str, request: type[Request], **fields: Any) -> str:
        action_id = uuid.uuid4().hex
        self._call(keys.goal(part, verb), request, Started, epoch=self._taken[part].epoch, action_id=action_id, **fields)
        return action_id

    def _is_done(self, part: str, taken: _Taken) -> bool:
        reach, motion = self._known.reaches.get(part), self._known.motions.get(part)
        if motion is not None and motion.epoch != taken.epoch:  # another client has it, or a new controller
            return True
        if not taken.reach or reach is None or reach.action_id != taken.reach or reach.phase in ("reaching", "returning"):
            return False
        taken.over_since = taken.over_since or time.monotonic()
        return time.monotonic() - taken.over_since > AFTER_REACH


def _place_of(given: Any) -> Array:
    place = np.array(given, dtype=np.float64)
    if place.shape != (3,) or not np.isfinite(place).all() or np.linalg.norm(place) > FARTHEST:
        raise Refused(f"{given!r} is not a place: give three coordinates in m, at most {FARTHEST:g} m from the robot")
    return place
