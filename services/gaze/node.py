# SPDX-License-Identifier: Apache-2.0
"""Runs the gaze: from the newest tick and the places of the target to the moving attractor of a part."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from bus_schema.messages import Tick, WorldObject
from mobee.arrays import Array
from mobee.behaviours.target import TargetTrack
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot
from services.common.followed_part import FollowedPart
from services.common.rate import NOT_MEASURED, Percentiles
from services.common.service import Service
from services.gaze.config import Config

LONGEST_STEP = 0.1  # s: after a longer gap between two ticks the motion continues as if only this time had passed


class GazeNode:
    """Moves the attractor of a part while it has a target and owns the part's goal; otherwise it pauses, and reports why."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._service, self._config, self._robot = service, config, robot
        self._gaze, self._track = config.gaze(robot), TargetTrack(config.patience)
        self._part = FollowedPart(service, robot, config.part)
        self._marker = robot.markers.get(config.target)
        self._last = -np.inf  # s, bus clock, of the last step
        self._seen = -np.inf  # s, bus clock, of the last step with a target
        self._hold: Array | None = None  # (n_part,) rad, where the part holds
        self._pause = "no target yet"  # why it pauses; empty: it follows
        self._errors, self._times = Percentiles(), Percentiles()
        self._mark()
        service.mark, service.describe = self._mark, self._describe
        service.on_run(self._forget)
        if self._marker is None:
            service.on_newest(WorldObject, self._note_object, config.target)
        service.on_tick(self._tick)

    def _note_object(self, thing: WorldObject) -> None:
        try:
            self._track.note(thing.t_capture * 1e-9, np.array(thing.position))
        except InvalidValue as error:
            self._service.bus.reject("value", str(error))

    def _tick(self, tick: Tick) -> None:
        now = tick.t * 1e-9
        if tick.mode == "paused" or now - self._last < 1.0 / self._config.rate - 1e-6:
            return
        begin, dt = time.perf_counter(), min(now - self._last, LONGEST_STEP)
        self._last = now
        q = np.array(tick.q)
        if self._marker is not None:
            link = link_transforms(self._robot, q)[self._marker.link]
            self._track.note(now, link[:3, :3] @ self._marker.position + link[:3, 3])
        known = self._track.at(now)
        why = f"no place of {self._config.target} for {self._config.patience:g} s" if known is None else self._part.why_not()
        self._report(why)
        if known is not None:
            self._seen = now
        if why or known is None:
            self._wait(q, known is not None, now)
            return
        self._hold = None
        moved = self._gaze.step(q, self._part.velocities(), *known, dt)
        self._part.move(moved.q, moved.velocity)
        self._steps += 1
        self._errors.add(np.rad2deg(moved.error))
        self._times.add(1e3 * (time.perf_counter() - begin))

    def _wait(self, q: Array, has_target: bool, now: float) -> None:
        """Hold the part where it is; take it when there is a target, and release it when there was none for long."""
        self._gaze.reset()
        if self._part.is_owned and not has_target:
            if self._hold is None:
                self._hold = q[self._robot.part(self._config.part).slice]
            self._part.move(self._hold, np.zeros(len(self._hold)))
            if now - self._seen > self._config.release_after:
                self._part.release()
        else:
            self._hold = None
            if has_target:
                self._part.take()

    def _report(self, why: str) -> None:
        """Publish an event when the gaze pauses or continues."""
        if why != self._pause:
            name, text = ("gaze_paused", f"the gaze pauses: {why}") if why else ("gaze_follows", f"the gaze follows {self._config.target}")
            self._service.bus.event("info", name, text)
            self._pause = why

    def _forget(self) -> None:
        self._track.forget()
        self._gaze.reset()
        self._part.forget()
        self._last = self._seen = -np.inf
        self._hold = None

    def _mark(self) -> None:
        self._steps = 0
        self._errors.clear()
        self._times.clear()

    def _describe(self) -> tuple[str, Mapping[str, float]]:
        numbers = {
            "steps": self._steps,
            "follows": float(not self._pause),
            "error_deg_p50": self._errors.at(50) if self._steps else NOT_MEASURED,
            "error_deg_p99": self._errors.at(99) if self._steps else NOT_MEASURED,
            "step_ms_p50": self._times.at(50) if self._steps else NOT_MEASURED,
            "step_ms_p99": self._times.at(99) if self._steps else NOT_MEASURED,
        }
        return self._pause and f"pauses: {self._pause}" or f"follows {self._config.target}", numbers
