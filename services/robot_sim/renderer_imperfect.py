# SPDX-License-Identifier: Apache-2.0
"""The renderer's imperfect cameras: an exposure shows the simulator's true posture, and has the encoders at its stamp."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bus_schema.messages import Tick, Truth
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.rendering.scene import Picture, Scene
from mobee.robot.robot import Robot
from mobee.vision.encoders import Readings
from mobee.vision.exposure import Cameras
from mobee.vision.imperfections import CameraErrors, CameraSettings
from services.common.service import Service

TRUTHS = 128  # messages that are kept
FARTHEST = 0.03  # s between two messages of the truth, between which postures are interpolated


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    """An exposure: its stamp [s] by the camera's clock, the encoders then, and its pictures, which are drawn when they are iterated.

    `q` (n,) rad and `dq` (n,) rad/s; `readings`: the number of readings of each encoder in them.
    """

    stamp: float
    q: Array
    dq: Array
    readings: int
    pictures: Iterator[tuple[str, Picture]]


class ImperfectCameras:
    """Follows truth and encoders on the bus, and exposes pictures in the recent past."""

    def __init__(self, service: Service, robot: Robot, scene: Scene, settings: CameraSettings, errors: CameraErrors, seed: int) -> None:
        """`seed`: of the noise in stamps and pictures."""
        self.settings, self.errors = settings, errors
        self._scene, self._bus = scene, service.bus
        self._cameras = Cameras(scene, settings, errors, seed)
        self._rng = np.random.default_rng([seed, 0x7374616D70])
        self._truths: deque[tuple[float, Array]] = deque(maxlen=TRUTHS)
        self._parts = {name: part.slice for name, part in robot.parts.items()}
        self._readings = Readings(self._parts, len(robot.motors))
        self._ticked = 0.0  # s, time of the newest tick
        service.on_each(Truth, self._note_truth)
        service.on_each(Tick, self._note_tick)

    def forget(self) -> None:
        """Drop what was before, at the start of a new run."""
        self._truths.clear()
        self._readings.forget()
        self._ticked = 0.0

    @property
    def latency(self) -> int:
        """The true latency of the pictures, ns, without the time for which they are drawn."""
        return round(1e9 * (self.settings.latency + self.errors.latency))

    @property
    def newest(self) -> int:
        """The time until which truth and encoders are known, ns: messages that wait are handled after the clock's."""
        return round(1e9 * min(self._truths[-1][0], self._ticked)) if self._truths else 0

    def expose(self, t: float) -> Exposure:
        """Return the exposure whose middle is at time t [s]; raises InvalidValue if truth or encoders are missing around it."""
        stamp = t + self.errors.latency + self.settings.jitter * float(self._rng.standard_normal())
        q, dq, readings = self._readings.at(stamp)
        postures = [self._true_at(t + moment) for moment in self._cameras.moments]
        return Exposure(stamp, q, dq, readings, ((name, self._cameras.expose(name, postures)) for name in self._scene.cameras))

    def _true_at(self, t: float) -> Array:
        times = np.array([time for time, _ in self._truths])
        after = int(np.searchsorted(times, t))
        if not 0 < after < len(times) or times[after] - times[after - 1] > FARTHEST:
            raise InvalidValue(f"no messages sim/truth within {FARTHEST} s around {t:.3f} s: set services.robot_sim.truth_rate = 100")
        (before, first), (later, second) = self._truths[after - 1], self._truths[after]
        share = (t - before) / (later - before)
        return (1.0 - share) * first + share * second

    def _note_truth(self, truth: Truth) -> None:
        t = 1e-9 * (truth.t + self._bus.dt)  # the physics has advanced by the tick that began at truth.t
        if not self._truths or t > self._truths[-1][0]:
            self._truths.append((t, np.array(truth.q)))
        for thing in truth.objects:
            self._scene.place(thing.name, np.array(thing.position), np.array(thing.quaternion))

    def _note_tick(self, tick: Tick) -> None:
        q, self._ticked = np.array(tick.q), 1e-9 * tick.t
        for part, status in tick.parts.items():
            self._readings.note(part, 1e-9 * status.t, q[self._parts[part]])
