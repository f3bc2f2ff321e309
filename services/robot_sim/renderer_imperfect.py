# SPDX-License-Identifier: Apache-2.0
"""The renderer's imperfect cameras: pictures of the true posture, with an inexact time stamp and the encoder values at this stamp."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bus_schema.messages import Tick, Truth
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.rendering.scene import Picture, Scene
from mobee.robot.robot import Robot
from mobee.vision.encoders import Readings
from mobee.vision.imperfections import CameraErrors, Cameras, CameraSettings
from services.common.service import Service

TRUTHS = 128  # messages that are kept
FARTHEST = 0.03  # s between two messages of the truth, between which postures are interpolated


@dataclass(frozen=True, slots=True, eq=False)
class Stamp:
    """The time `t` [s] of an exposure by the camera's clock, and the encoder values at that time: `q` (n,) rad and `dq` (n,) rad/s.

    `readings`: number of readings of each encoder from which `q` and `dq` were computed.
    """

    t: float
    q: Array
    dq: Array
    readings: int


class ImperfectCameras:
    """Receives the true postures of the simulator and the encoder values from the bus, and draws the pictures of past exposures."""

    def __init__(
        self,
        service: Service,
        robot: Robot,
        scene: Scene,
        settings: CameraSettings,
        errors: CameraErrors,
        seed: int,
        on_truth: Callable[[], None],
        on_encoders: Callable[[], None],
    ) -> None:
        """Subscribe to the messages `sim/truth` (true postures) and `tick` (encoder values).

        `seed`: of the noise in stamps and pictures. `on_truth`: called after each `sim/truth` message. `on_encoders`: called after each
        `tick` message.
        """
        self.settings, self.errors = settings, errors
        self._scene, self._bus = scene, service.bus
        self._on_truth, self._on_encoders = on_truth, on_encoders
        self._cameras = Cameras(scene, settings, errors, seed)
        self._rng = np.random.default_rng([seed, 0x7374616D70])
        self._truths: deque[tuple[float, Array]] = deque(maxlen=TRUTHS)
        self._parts = {name: part.slice for name, part in robot.parts.items()}
        self._readings = Readings(self._parts, len(robot.motors))
        self._ticked = 0.0  # s, time of the newest tick
        service.on_each(Truth, self._note_truth)
        service.on_each(Tick, self._note_tick)

    def forget(self) -> None:
        """Drop all postures and encoder values; call this at the start of a new run."""
        self._truths.clear()
        self._readings.forget()
        self._ticked = 0.0

    @property
    def exposed(self) -> int:
        """The middle of the newest exposure that can be drawn, ns of the bus clock; 0 if there is none.

        An exposure can be drawn when messages `sim/truth` with the true postures up to its end have arrived.
        """
        return round(1e9 * (self._truths[-1][0] - 0.5 * self.settings.exposure)) if self._truths else 0

    @property
    def arrived(self) -> int:
        """The time of the newest tick minus the true latency of the cameras, ns of the bus clock.

        The pictures of all exposures whose middle is at or before this time have left the cameras.
        """
        return round(1e9 * (self._ticked - self.settings.latency - self.errors.latency))

    def postures(self, t: float) -> list[Array]:
        """Return the true postures (n,) rad at several moments of the exposure whose middle is at the time t [s].

        Raises InvalidValue if messages `sim/truth` around that time are missing.
        """
        return [self._true_at(t + moment) for moment in self._cameras.moments]

    def draw(self, name: str, postures: list[Array]) -> Picture:
        """Return the picture that the camera `name` takes in one exposure.

        `postures`: true postures at several moments of the exposure, as the method `postures` returns them; the picture is blurred by the
        motion.
        """
        return self._cameras.expose(name, postures)

    def stamp(self, t: float) -> Stamp:
        """Return the stamp of the exposure at the true time t [s], with the constant error and the jitter of the camera's clock.

        Raises InvalidValue if readings of the encoders around that time are missing.
        """
        stamp = t + self.errors.latency + self.settings.jitter * float(self._rng.standard_normal())
        return Stamp(stamp, *self._readings.at(stamp))

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
        self._on_truth()

    def _note_tick(self, tick: Tick) -> None:
        q, self._ticked = np.array(tick.q), 1e-9 * tick.t
        for part, status in tick.parts.items():
            self._readings.note(part, 1e-9 * status.t, q[self._parts[part]])
        self._on_encoders()
