# SPDX-License-Identifier: Apache-2.0
"""A simulated robot that watches its own hand: it moves through postures on the offline plant, and its cameras take pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.model.model import Model
from mobee.rendering.scene import Picture, Scene, clutter, room
from mobee.simulation.plant import OfflinePlant
from mobee.vision.calibration.calibration import Observation
from mobee.vision.encoders import Moment, moment_at
from mobee.vision.exposure import Cameras
from mobee.vision.imperfections import HEAD, CameraErrors, CameraSettings
from mobee.vision.rig import Rig
from mobee.vision.tag import find_tag, tag_solids

MOVING, RESTING = 1, 2  # pictures of each posture while the robot moves to it, and when it has arrived
PERIOD = 1.0 / 15.0  # s between two pictures at rest
STEP = 0.05  # s between two checks whether the robot has arrived
LONGEST = 6.0  # s for one motion


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A recorded motion of a simulated robot, with one row for each tick.

    `encoders`: (m, n) rad at `times` (m,) s. `q`: (m, n) rad, true positions; row k is at times[k] + dt. `dt`: duration of a tick [s].
    """

    times: Array
    encoders: Array
    q: Array
    dt: float

    def true_at(self, t: float) -> Array:
        """Return the true positions (n,) rad at time t [s], interpolated between ticks."""
        place = (t - self.times[0]) / self.dt - 1.0
        row = int(np.clip(np.floor(place), 0, len(self.q) - 2))
        share = place - row
        found: Array = (1.0 - share) * self.q[row] + share * self.q[row + 1]
        return found


class Watcher:
    """A simulated robot with imperfect cameras and a tag on its palm, which moves and takes pictures.

    Args:
        rig: the robot, its cameras and the tag.
        model: the robot in its world.
        settings: settings of the cameras.
        errors: by how much the simulated cameras, encoders and tag differ from the model.
        seed: seed of the noise of the encoders, of the pictures and of the times at which these were taken; also of the furniture and
            lamps of the room, and of the clutter.
        has_clutter: whether sheets and discs of paper lie on the boxes of the world.
    """

    def __init__(self, rig: Rig, model: Model, settings: CameraSettings, errors: CameraErrors, seed: int, has_clutter: bool = True) -> None:
        self.rig, self.settings, self.errors = rig, settings, errors
        self.plant = OfflinePlant(model, seed=seed)
        worn = [] if rig.tag is None else tag_solids(rig.tag, rig.robot, errors.tag)
        around = [*room(seed), *(clutter(model.world.objects.values(), seed) if has_clutter else ())]
        self.scene = Scene(rig.robot, model.world, rig.cameras, worn=worn, around=around)
        self._cameras = Cameras(self.scene, settings, errors, seed)
        self._rng = np.random.default_rng([seed, 0x7374616D70])

    def move(self, posture: Array, parts: Sequence[str], rest: float) -> tuple[Motion, float]:
        """Move the parts to a posture and stay there for `rest` [s].

        `posture`: (n,) rad, positions of all motors of the robot; those of other parts are not used. Returns the recorded motion, and the
        time of the plant [s] at which the robot arrived, or at which the time limit of 6 s ended.
        """
        plant, start, traces = self.plant, self.plant.time, []
        for part in parts:
            plant.begin(part, posture[self.rig.robot.part(part).slice])
        while plant.acting and plant.time - start < LONGEST:
            traces.append(plant.run(round(STEP / plant.dt)))
        arrived = plant.time
        traces.append(plant.run(round(rest / plant.dt)))
        encoders, q = (np.concatenate([getattr(one, name) for one in traces]) for name in ("encoders", "q"))
        times: Array = start + plant.dt * np.arange(len(q), dtype=np.float64)
        return Motion(times, encoders, q, plant.dt), arrived

    def look(self, motion: Motion, t: float) -> tuple[Moment, dict[str, Picture]]:
        """Take a picture with every camera; the middle of the exposure is at time t [s] of `motion`.

        Returns the encoders at the stamp, and the pictures by name of the camera. The stamp differs from t by the error of the latency and
        by jitter.
        """
        stamp = t + self.errors.latency + self.settings.jitter * self._rng.standard_normal()
        postures = [motion.true_at(t + moment) for moment in self._cameras.moments]
        pictures = {name: self._cameras.expose(name, postures) for name in self.rig.cameras}
        noise = self.plant.motors.noise(self.plant.dt)
        return moment_at(motion.times, motion.encoders, stamp, noise), pictures


def moved_parts(rig: Rig, part: str) -> tuple[str, ...]:
    """Return the parts that move during a calibration: the head, if the robot has one, and the arm `part`."""
    return (HEAD, part) if HEAD in rig.robot.parts else (part,)


def watch_hand(watcher: Watcher, postures: Array, part: str, progress: Callable[[float], None] = lambda share: None) -> list[Observation]:
    """Move the head and the arm `part` through postures (K, n) rad; return the observations of the tag from the cameras.

    `progress`: called with the share of postures that are done, 0 to 1. The offsets of the head's encoders (`CameraErrors.encoders`) are
    simulated in the pictures only: a picture shows the head, with its cameras, at the simulated posture plus the offsets; the recorded
    encoder values are those of the simulated posture, with noise.
    """
    rest, found = RESTING * PERIOD + 0.1, []
    for number, posture in enumerate(postures):
        motion, arrived = watcher.move(posture, moved_parts(watcher.rig, part), rest)
        begin = float(motion.times[0])
        moving = [begin + share * (arrived - begin) for share in np.linspace(0.2, 0.5, MOVING)]
        for t in [*moving, *(arrived + 0.04 + PERIOD * k for k in range(RESTING))]:
            moment, pictures = watcher.look(motion, t)
            seen = {name: corners for name, picture in pictures.items() if (corners := find_tag(picture, watcher.rig.lens)) is not None}
            if seen:
                found.append(Observation(moment, seen))
        progress((number + 1) / len(postures))
    return found
