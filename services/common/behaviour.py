# SPDX-License-Identifier: Apache-2.0
"""A behaviour as a process: moves a part depending on a target's position, pauses while it cannot, and reports why (docs/behaviours.md)."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from bus_schema.messages import Tick, WorldObject
from mobee.arrays import Array
from mobee.behaviours.tracking import TargetTrack
from mobee.control.gains import Gains
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.robot.motor_units import limit_zones
from mobee.robot.robot import Robot
from services.common.config import ServiceConfig
from services.common.followed_part import FollowedPart
from services.common.rate import NOT_MEASURED, Percentiles
from services.common.service import Service

LONGEST_STEP = 0.1  # s: after a longer gap between two ticks the motion continues as if only this time had passed


class BehaviourConfig(ServiceConfig, frozen=True, kw_only=True):
    """Settings that every behaviour has; a behaviour is a service that moves one part depending on a target's position."""

    part: str = ""
    """Part that the behaviour moves."""
    target: str = "ball"
    """What the behaviour follows: the name of an object that vision finds, or of a marker of the robot."""
    gains: Literal["default", "derived", "published_2014"] = "published_2014"
    """Name of the controller's set of gains. Motors that this set never moves are not used."""
    rate: Annotated[float, Meta(ge=20, le=200)] = 50.0
    """Number of times per second at which the attractor of the part is moved."""
    patience: Annotated[float, Meta(ge=0.1, le=5)] = 0.6
    """Time without a new position of the target after which the part stops and holds, in s of simulated time."""
    release_after: Annotated[float, Meta(ge=0.1, le=3600)] = 10.0
    """Time without a target after which the part is released, in s of simulated time."""

    def margin(self, robot: Robot) -> Array:
        """Return the width of each motor's limit zone, (n,) rad: within it, the control law pushes the motor away from the limit.

        If the zones at a motor's two limits differ, the width is that of the wider one.
        """
        zones: Array = limit_zones(robot, Gains.named(self.gains).of_robot("limit_width", robot)).max(axis=1)
        return zones


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What a behaviour perceives in one step, at the time of a tick.

    `q`, `velocity`: encoder values (n,) rad and commanded velocities (n,) rad/s of all motors. `place`, `place_velocity`: position (3,) m
    and velocity (3,) m/s of the target, root frame. `dt`: time since the last step, s.
    """

    q: Array
    velocity: Array
    place: Array
    place_velocity: Array
    dt: float


class Behaviour:
    """Runs a behaviour: in each step, sets the attractor of its part (the posture to which the part moves) to the result of `step`.

    `step(scene)`: returns the attractor (n_part,) rad and its velocity (n_part,) rad/s for a `Scene`. `reset()`: ends the present motion.
    If the target has no new position for the time `patience` of the settings, the part stays where it is; if the argument
    `watches_last_place` is True, the behaviour continues instead as if the target were at rest at its last position.
    """

    def __init__(
        self,
        service: Service,
        config: BehaviourConfig,
        robot: Robot,
        step: Callable[[Scene], tuple[Array, Array]],
        reset: Callable[[], None],
        watches_last_place: bool = False,
    ) -> None:
        self._service, self._config, self._robot, self._step, self._reset = service, config, robot, step, reset
        self._track, self._part = TargetTrack(config.patience), FollowedPart(service, robot, config.part)
        self._marker = robot.markers.get(config.target)
        self._last = -np.inf  # s, bus clock, of the last step
        self._seen = -np.inf  # s, bus clock, of the last step with a target
        self._hold: Array | None = None  # (n_part,) rad, where the part holds
        self._watches_last_place = watches_last_place
        self._last_place = np.zeros(3)  # m, of the target
        self._pause = f"no place of {config.target} yet"  # why it pauses; empty: it follows
        self._times = Percentiles()
        self.mark()
        service.on_run(self._forget)
        if self._marker is None:
            service.on_newest(WorldObject, self._note_object, config.target)
        service.on_tick(self._tick)

    @property
    def status(self) -> str:
        """What the behaviour does, or why it pauses, as a text."""
        return f"pauses: {self._pause}" if self._pause else f"follows {self._config.target}"

    def numbers(self) -> Mapping[str, float]:
        """Return the numbers of the current measurement, by name, for the call `stat`.

        "steps": number of steps since the last `mark`. "follows": True while the part follows the target. "step_ms_p50", "step_ms_p99":
        percentiles of the computing time of a step [ms]; -1: there was no step.
        """
        times = {f"step_ms_p{p}": self._times.at(p) if self._steps else NOT_MEASURED for p in (50, 99)}
        return {"steps": self._steps, "follows": not self._pause, **times}

    def mark(self) -> None:
        """Begin a measurement: set the number of steps to 0 and drop the measured times."""
        self._steps = 0
        self._times.clear()

    def _note_object(self, thing: WorldObject) -> None:
        try:
            self._track.note(thing.t_capture * 1e-9, np.array(thing.position))
        except InvalidValue as error:
            self._service.bus.reject("value", str(error))

    def _tick(self, tick: Tick) -> None:
        now = tick.t * 1e-9
        if tick.mode == "paused" or now - self._last < 1.0 / self._config.rate - 1e-6:
            return
        begin, dt, self._last = time.perf_counter(), min(now - self._last, LONGEST_STEP), now
        q = np.array(tick.q)
        if self._marker is not None:
            link = link_transforms(self._robot, q)[self._marker.link]
            self._track.note(now, link[:3, :3] @ self._marker.position + link[:3, 3])
        known = self._track.at(now)
        if known is None:
            self._report(f"no place of {self._config.target} for {self._config.patience:g} s")
            self._wait(q, now, dt)
            return
        self._seen, self._hold, self._last_place = now, None, known[0]
        why = self._part.why_not()
        self._report(why)
        if why:
            self._reset()
            self._part.take()
            return
        self._part.move(*self._step(Scene(q, self._part.velocities(), *known, dt)))
        self._steps += 1
        self._times.add(1e3 * (time.perf_counter() - begin))

    def _wait(self, q: Array, now: float, dt: float) -> None:
        """Let the part rest, or keep it directed at the last place of the target; release it when there was no target for long."""
        if not self._part.is_owned:
            self._reset()
            self._hold = None
        elif self._watches_last_place and not self._part.why_not():
            self._part.move(*self._step(Scene(q, self._part.velocities(), self._last_place, np.zeros(3), dt)))
        else:
            self._reset()
            if self._hold is None:
                self._hold = q[self._robot.part(self._config.part).slice]
            self._part.move(self._hold, np.zeros(len(self._hold)))
        if self._part.is_owned and now - self._seen > self._config.release_after:
            self._part.release()

    def _report(self, why: str) -> None:
        """Publish an event when the behaviour pauses or continues."""
        if why != self._pause:
            who, self._pause = self._service.who, why
            self._service.bus.event("info", f"{who}_pauses" if why else f"{who}_follows", f"{who} {self.status}")

    def _forget(self) -> None:
        self._track.forget()
        self._reset()
        self._part.forget()
        self._last = self._seen = -np.inf
        self._hold = None
