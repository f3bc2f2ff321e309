# SPDX-License-Identifier: Apache-2.0
"""Chooses postures in which a robot sees the AprilTag on its palm, and observes the tag with a simulated robot in these postures.

In the chosen postures the tag is near and well spread in the pictures of all cameras, and nothing is in contact. The simulated robot moves
through them on the offline plant, and its cameras take pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.rendering.scene import Picture, Scene, clutter, room
from mobee.simulation.plant import OfflinePlant
from mobee.vision.calibration.calibration import Observation
from mobee.vision.encoders import Moment, moment_at
from mobee.vision.imperfections import HEAD, CameraErrors, Cameras, CameraSettings
from mobee.vision.lens import camera_frames, into
from mobee.vision.rig import Rig
from mobee.vision.tag import find_tag, tag_solids

BATCH, FIRST, NEXT = 4_000, 60, 14  # postures drawn at once; how often at most until one fits; and how often about those that fit
FOUNDERS = 4  # random postures that fit, about which others are drawn
NEAR = 0.12  # of a motor's range: standard deviation of postures about one that fits
NEAREST, FARTHEST = 0.20, 0.45  # m, of the tag from a camera
FACING = 0.70  # cosine: the tag is turned to a camera by at least this much
BORDER = 30.0  # px of the picture's border in which the tag is not shown, since the cameras may be turned a little
LIMIT = 0.04  # share of a motor's range that is left free at its limits
MOVING, RESTING = 1, 2  # pictures of each posture while the robot moves to it, and when it has arrived
PERIOD = 1.0 / 15.0  # s between two pictures at rest
STEP = 0.05  # s between two checks whether the robot has arrived
LONGEST = 6.0  # s for one motion


def choose_postures(rig: Rig, model: Model, settings: CameraSettings, part: str, count: int, seed: int) -> Array:
    """Return postures (count, n) rad of the head and one arm in which all cameras see the AprilTag on the palm, without contacts.

    The other motors are at home. Postures are drawn at random within the limits. Of the suitable ones, each next posture is the one
    farthest from those already chosen, by the tag's position in the pictures, its distance and angle, and the positions of the head's
    motors. The result is sorted such that successive postures are near each other.

    Args:
        rig: the robot, its cameras and the tag.
        model: robot and world, for the contacts.
        settings: settings of the cameras.
        part: name of the arm.
        count: number of postures.
        seed: seed of the random draws.

    Raises:
        InvalidValue: too few suitable postures were found.
    """
    rng = np.random.default_rng([seed, 0x706F7365])
    free: Ints = np.array([*rig.head, *range(*rig.robot.part(part).slice.indices(len(rig.robot.motors)))], dtype=np.intp)
    free = free[_moves(rig, free)]
    kept, seen = _search(rig, model, settings, free, rng)
    if len(kept) < count:
        raise InvalidValue(
            f"only {len(kept)} of the postures of {part} that were tried show the tag to all cameras without contact, and {count} were "
            "asked for. Ask for fewer, or move the objects in the way."
        )
    chosen = _spread(seen, count)
    found: Array = kept[chosen[_in_order(kept[chosen][:, free])]]
    return found


def _search(rig: Rig, model: Model, settings: CameraSettings, free: Ints, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return suitable postures (K, n) rad for the calibration, and features (K, f) by which different postures are selected from them.

    `_fitting` decides which postures are suitable: the cameras see the tag and nothing touches. The postures are first drawn at random;
    after FOUNDERS have been found, they are drawn near those. The features have no unit: positions of the head's motors, and the tag in the
    pictures.
    """
    home, low, span = rig.robot.home, rig.robot.limits[free, 0], np.ptp(rig.robot.limits[free], axis=1)
    kept, seen, later = np.empty((0, len(home))), list[Array](), 0
    for _ in range(FIRST + NEXT):
        shares = rng.uniform(LIMIT, 1.0 - LIMIT, (BATCH, len(free)))
        if len(kept) >= FOUNDERS:
            about = (kept[rng.integers(len(kept), size=BATCH)][:, free] - low) / span
            shares = np.clip(about + NEAR * rng.standard_normal(shares.shape), LIMIT, 1.0 - LIMIT)
            later += 1
        drawn = np.repeat(home[None], BATCH, axis=0)
        drawn[:, free] = low + shares * span
        fits, features = _fitting(rig, model, settings, drawn)
        kept = np.concatenate([kept, drawn[fits]])
        seen.append(features)
        if later == NEXT:
            break
    return kept, np.concatenate(seen)


def _moves(rig: Rig, free: Ints) -> NDArray[np.bool_]:
    """Return which of the motors move a camera or the tag."""
    assert rig.tag is not None
    robot, matrix = rig.robot, rig.robot.coupling[0]
    moving = set[int]()
    for link in (rig.tag.frame(robot)[0], *(camera.link for camera in rig.cameras.values())):
        while link > 0:
            moving |= set(np.flatnonzero(matrix[link - 1]).tolist())
            link = robot.joints[link - 1].parent
    return np.array([motor in moving for motor in free])


def _fitting(rig: Rig, model: Model, settings: CameraSettings, postures: Array) -> tuple[Ints, Array]:
    """Return the indices (K,) of the suitable postures among `postures` (B, n) rad, and features (K, f) that describe what they show.

    A posture is suitable if all cameras see the tag, at a permitted distance, not too oblique and not near the border of the picture.
    Besides, no contacts are found and the constraints of the joints hold. The features, without a unit, are: positions of the head's motors
    within their limits; for each camera the tag's position in the picture, its distance and the direction of its normal.
    """
    assert rig.tag is not None
    robot = rig.robot
    low, high = robot.limits[list(rig.head)].T
    transforms = model.evaluate(postures).transforms
    link, position, rotation = rig.tag.frame(robot)
    hand = transforms[:, link, :3, :]
    at, inwards = hand[..., :3] @ position + hand[..., 3], hand[..., :3] @ rotation[:, 2]
    fits, features = np.ones(len(postures), bool), [(postures[:, list(rig.head)] - low) / (high - low)]
    for camera in rig.cameras.values():
        centre, axes = camera_frames(camera, transforms, np.zeros(6))
        local = into(centre, axes, at)
        distance = np.linalg.norm(local, axis=1)
        facing = np.einsum("ki,ki->k", inwards, at - centre) / distance
        pixels = rig.lens.project(local)
        inside = ((pixels > BORDER) & (pixels < np.array([settings.width, settings.height]) - BORDER)).all(axis=1)
        fits &= inside & (distance > NEAREST) & (distance < FARTHEST) & (facing > FACING) & ((local[:, :2] ** 2).sum(1) < local[:, 2] ** 2)
        features += [pixels / settings.width, 4.0 * distance[:, None]]
        features.append(2.0 * np.einsum("kji,kj->ki", axes, inwards)[:, :2])
    which = np.flatnonzero(fits)
    kept = which[model.evaluate(postures[which]).count == 0] if len(which) else which
    kept = kept[[all((clause.a @ postures[k] + clause.b).max() > 0.0 for clause in robot.clauses) for k in kept]] if len(kept) else kept
    return kept, np.concatenate(features, axis=1)[kept]


def _spread(features: Array, count: int) -> Array:
    """Return the indices (count,) of rows that are far from each other: each next one is the farthest from those before."""
    scaled = features / np.maximum(features.std(axis=0), 1e-9)
    chosen = [int(np.linalg.norm(scaled - scaled.mean(axis=0), axis=1).argmin())]
    nearest = np.full(len(scaled), np.inf)
    while len(chosen) < count:
        nearest = np.minimum(nearest, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
        chosen.append(int(nearest.argmax()))
    return np.array(chosen, dtype=np.intp)


def _in_order(postures: Array) -> Array:
    """Return the indices (K,) that order postures (K, d): the first posture first, then always the nearest of the others.

    The distance of two postures is the largest difference of an angle.
    """
    left, order = set(range(1, len(postures))), [0]
    while left:
        rest = np.array(sorted(left))
        order.append(int(rest[np.abs(postures[rest] - postures[order[-1]]).max(axis=1).argmin()]))
        left.remove(order[-1])
    return np.array(order, dtype=np.intp)


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
