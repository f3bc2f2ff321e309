# SPDX-License-Identifier: Apache-2.0
"""Lessons of a robot that learns to see: observations of a ball, with the positions that a teacher has reported, and how they are made.

Two simulated robots take part. The teacher carries the ball to places in a volume, and reports the ball's position. The learner has
cameras, and moves torso and head to postures in which both of its cameras see the ball.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.robot.robot import Robot
from mobee.vision.ball import find_balls
from mobee.vision.calibration.observing import PERIOD, Watcher
from mobee.vision.encoders import Moment
from mobee.vision.lens import camera_frames, into
from mobee.vision.rig import Rig, see_points

PARTS = ("torso", "head")
"""Names of the parts that move the cameras; their encoders are inputs of a localiser."""
BATCH, ROUNDS = 4_000, 60  # postures drawn at once, and how often at most
GAZES, STEPS, LEAP, DAMPING = 60, 6, 80.0, 20.0  # postures drawn at once; least squares: steps, px of one at most, px/rad
STEEP = 5e3  # px/rad, above all slopes in a picture
BORDER = 30.0  # px of the picture's border in which the ball is not looked for, since the cameras may be turned a little
DISTANCES = (0.20, 0.65)  # m, of the ball from a camera
LIMIT = 0.2  # rad, of the teacher from its limits, which push within 10 degrees
ARRIVED = 0.1  # rad, of the teacher from its posture: beyond it, something was in its way
MOTIONS = 3  # of the time that `Watcher.move` takes at most, until the teacher gives up
REST = 0.1  # s after the robots have arrived
ALIKE = 1.35  # ratio of the ball's sizes in the two pictures, at most
BALL = "ball"  # the name of the world's object that is shown


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """An observation of a ball in the pictures of both cameras of the learner, with the position that the teacher reports.

    The teacher is a robot that carries the ball; the learner is a robot that learns to locate it.

    `pixels`: (2, 2) px, column and row of the ball in the left picture, then in the right one. `moment`: the learner's encoders at the
    time stamp of the pictures. `reported`: (3,) m, root frame, position of the ball that the teacher reports. `true`: its true position.
    `pose`: index of the teacher's pose.
    """

    pixels: Array
    moment: Moment
    reported: Array
    true: Array
    pose: int


@dataclass(frozen=True, slots=True, eq=False)
class Lessons:
    """N lessons (`Lesson`) as arrays.

    `inputs`: (N, d), column and row of the ball in the left picture, then in the right one [px], then the encoders of torso and head [rad].
    `reported`: (N, 3) m, root frame, positions of the ball that the teacher, the robot that carries it, reports. `true`: its true
    positions. `poses`: (N,), index of the teacher's pose.
    """

    inputs: Array
    reported: Array
    true: Array
    poses: Ints

    @classmethod
    def of(cls, robot: Robot, lessons: list[Lesson]) -> Lessons:
        """Convert a list of lessons to arrays."""
        seeing = seeing_motors(robot)
        rows = [np.concatenate([one.pixels.ravel(), one.moment.q[seeing]]) for one in lessons]
        reported, true = (np.array([getattr(one, name) for one in lessons]) for name in ("reported", "true"))
        return cls(np.array(rows), reported, true, np.array([one.pose for one in lessons], dtype=np.intp))

    def __len__(self) -> int:
        return len(self.inputs)

    def __getitem__(self, rows: Ints | slice) -> Lessons:
        return Lessons(self.inputs[rows], self.reported[rows], self.true[rows], self.poses[rows])


def seeing_motors(robot: Robot) -> Ints:
    """Return the indices of the motors of torso and head, which move the cameras, in this order."""
    found: Ints = np.concatenate([np.arange(len(robot.motors))[robot.part(part).slice] for part in PARTS])
    return found


def split_by_pose(poses: Ints, held_out: float, seed: int) -> tuple[Ints, Ints]:
    """Split rows of lessons; return the indices of the rows to learn from, and those of the rows to test with.

    `poses`: (N,) index of the teacher's pose in each row; the teacher is the robot that shows the ball. All rows of a pose belong to the
    same set. `held_out`: share of the poses whose rows are for tests, 0 to 1; at least one pose is for tests. In the rows to learn from,
    the rows of each pose are together, and the poses are in random order. So one can learn from few poses by taking only the first rows.
    `seed`: seed of the random order.
    """
    each = np.random.default_rng([seed, 0x73706C69]).permutation(np.unique(poses))
    kept = len(each) - max(1, round(held_out * len(each)))
    learned: Ints = np.concatenate([np.flatnonzero(poses == pose) for pose in each[:kept]])
    return learned, np.flatnonzero(np.isin(poses, each[kept:]))


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """A ball that the teacher, one of two robots, carries.

    `link`: name of the link to which the ball is fixed, in the model of both robots together. `position`: (3,) m, middle of the ball in the
    root frame at the zero pose.
    """

    link: str
    position: Array

    def place(self, rig: Rig, transforms: Array) -> Array:
        """Return the position of the ball (..., 3) m, root frame, in poses of the robots.

        `rig`: both robots as one model. `transforms`: (..., L, 4, 4) of all links, from the zero pose to each pose, root frame.
        """
        link = transforms[..., rig.robot.links.index(self.link), :3, :]
        found: Array = link[..., :3] @ self.position + link[..., 3]
        return found


def teacher_postures(rig: Rig, model: Model, carried: Carried, rest: Array, volume: tuple[Array, Array], count: int, seed: int) -> Array:
    """Return postures (count, n) rad in which the teacher, the robot that carries the ball, holds the ball within a volume.

    A posture has the positions of all n motors of both robots, teacher and learner; in no posture are solids in contact.

    Args:
        rig: both robots as one model, with the learner's cameras.
        model: the robots in their world, for the contacts.
        carried: the ball.
        rest: (n,) rad, positions of all motors. A motor that does not move the ball keeps its position; the other values are not used.
        volume: the lowest and the highest corner of the volume, (3,) m each, root frame.
        count: number of postures.
        seed: seed of the random draws.

    Raises:
        InvalidValue: too few postures were found.
    """
    robot, rng = rig.robot, np.random.default_rng([seed, 0x74656163])
    moving = _moving(rig, carried.link)
    low, high = robot.limits[moving].T
    kept = np.empty((0, len(rest)))
    for _ in range(ROUNDS):
        drawn = np.repeat(rest[None], BATCH, axis=0)
        drawn[:, moving] = rng.uniform(low + LIMIT, high - LIMIT, (BATCH, len(moving)))
        pose = model.evaluate(drawn)
        at = carried.place(rig, pose.transforms)
        kept = np.concatenate([kept, drawn[((at > volume[0]) & (at < volume[1])).all(axis=1) & (pose.count == 0)]])
        if len(kept) >= count:
            found: Array = kept[:count]
            return found
    raise InvalidValue(
        f"only {len(kept)} of {ROUNDS * BATCH} postures of the teacher put the ball into the volume without contact, and {count} were "
        "asked for. Give a larger volume, or ask for fewer."
    )


def gaze_postures(
    rig: Rig, model: Model, carried: Carried, posture: Array, share: float, size: tuple[int, int], count: int, rng: np.random.Generator
) -> Array:
    """Return postures (K, n) rad, K <= count, in which both cameras of the learner see the ball and no solids are in contact.

    The teacher carries the ball; the learner is the other robot. The cameras are assumed to be where the model has them. The postures of
    the learner's torso and head are drawn at random; then the head is turned to the ball.

    Args:
        rig: both robots as one model, with the learner's cameras.
        model: the robots in their world, for the contacts.
        carried: the ball.
        posture: (n,) rad, positions of all motors. All motors except torso and head keep them; the values of torso and head are not used.
        share: part of the torso's range that is used, 0 to 1; 0: the torso stays at its home posture, 1: the whole range.
        size: width and height of a picture, px.
        count: largest number of postures.
        rng: draws the postures.
    """
    kept = np.empty((0, len(posture)))
    motors = seeing_motors(rig.robot)
    low, high = _ranges(rig, share)
    for _ in range(ROUNDS):
        drawn = np.repeat(posture[None], GAZES, axis=0)
        drawn[:, motors] = rng.uniform(low[motors], high[motors], (GAZES, len(motors)))
        turned = _turned(rig, carried, drawn, (low, high), rng.uniform(BORDER, np.array(size) - BORDER, (GAZES, 2, 2)))
        transforms = link_transforms(rig.robot, turned)
        seen = turned[_seen(rig, transforms, carried.place(rig, transforms), size)]
        kept = np.concatenate([kept, seen[model.evaluate(seen).count == 0]]) if len(seen) else kept
        if len(kept) >= count:
            break
    found: Array = kept[:count]
    return found


def _turned(rig: Rig, carried: Carried, postures: Array, limits: tuple[Array, Array], pixels: Array) -> Array:
    """Turn the head of postures (B, n) rad until the model's cameras have the ball near pixels (B, cameras, 2), by damped least squares.

    The head stays within limits (n,), (n,) rad, so that not all postures returned show the ball.
    """
    head, x, found = list(rig.head), np.zeros(len(rig.names)), postures.copy()
    places = carried.place(rig, link_transforms(rig.robot, postures))[:, None]
    for _ in range(STEPS):
        seen = [see_points(rig, camera, x, found, np.zeros_like(found), places) for camera in rig.cameras]
        missing = np.nan_to_num(pixels - np.stack([one.pixels[:, 0] for one in seen], axis=1))
        slope = np.stack([one.by_posture[:, 0][..., head] for one in seen], axis=1)
        slope[~(np.abs(slope) < STEEP)] = 0.0  # of a ball beside or behind the camera
        jacobian, residual = slope.reshape(len(found), -1, len(head)), missing.reshape(len(found), -1, 1).clip(-LEAP, LEAP)
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian + DAMPING**2 * np.eye(len(head))
        step = np.linalg.solve(normal, np.swapaxes(jacobian, 1, 2) @ residual)[..., 0]
        found[:, head] = np.clip(found[:, head] + step, limits[0][head], limits[1][head])
    return found


def _ranges(rig: Rig, share: float) -> tuple[Array, Array]:
    """Return the limits from which postures of the learner are drawn: lowest values (n,) rad, then highest values (n,) rad.

    They are the motors' limits; but the torso has only a part, `share` (0 to 1), of the range on each side of its home posture.
    """
    robot = rig.robot
    low, high = robot.limits.T.copy()
    torso = robot.part("torso").slice
    low[torso] = robot.home[torso] + share * (low[torso] - robot.home[torso])
    high[torso] = robot.home[torso] + share * (high[torso] - robot.home[torso])
    return low, high


def _seen(rig: Rig, transforms: Array, places: Array, size: tuple[int, int]) -> Array:
    """Return (B,) whether all cameras of the rig see the ball at the positions `places` (B, 3) m, root frame.

    A camera sees it if it is in the picture (not within BORDER of its edge) and its distance is between 0.20 and 0.65 m (DISTANCES).
    `transforms`: link poses of the B postures. The cameras are where the model has them. `size`: width and height of a picture [px].
    """
    fits = np.ones(len(places), bool)
    for camera in rig.cameras.values():
        local = into(*camera_frames(camera, transforms, np.zeros(6)), places)
        pixels, distance = rig.lens.project(local), np.linalg.norm(local, axis=1)
        inside = ((pixels > BORDER) & (pixels < np.array(size) - BORDER)).all(axis=1)
        ahead = (local[:, :2] ** 2).sum(axis=1) < local[:, 2] ** 2  # beyond it the lens folds back
        fits &= inside & ahead & (distance > DISTANCES[0]) & (distance < DISTANCES[1])
    return fits


def _moving(rig: Rig, link: str) -> Ints:
    """Return the motors that move a link."""
    robot, number = rig.robot, rig.robot.links.index(link)
    moving = set[int]()
    while number > 0:
        moving |= set(np.flatnonzero(robot.coupling[0][number - 1]).tolist())
        number = robot.joints[number - 1].parent
    return np.array(sorted(moving), dtype=np.intp)


def watch_teacher(
    watcher: Watcher,
    carried: Carried,
    parts: Sequence[str],
    postures: Array,
    looks: int,
    share: float,
    seed: int,
) -> list[Lesson]:
    """Move the teacher through postures (K, n) rad; at each, look at the ball from several postures of the learner; return the lessons.

    The teacher is a robot that carries a ball; the learner is a robot with cameras that learns to locate it. A lesson is one observation of
    the ball in the pictures of both cameras, with the position that the teacher reports by its own encoders. All motions are controlled by
    the control law, which keeps the robots apart. If a picture shows several balls, the largest one is used. There is no lesson if a
    picture shows no ball, or if the ball in one picture is more than 1.35 times as large as in the other. A posture that the teacher does
    not reach is skipped.

    Args:
        watcher: the simulated robots, with an object "ball" in their world.
        carried: the ball, as the teacher carries it.
        parts: names of the teacher's parts.
        postures: (K, n) rad, of the teacher.
        looks: number of postures of the learner for each posture of the teacher.
        share: part of the torso's range that the learner uses, 0 to 1; 0: the torso stays at its home posture, 1: the whole range.
        seed: seed of the learner's postures.
    """
    rng, found = np.random.default_rng([seed, 0x6C6F6F6B]), list[Lesson]()
    size, model = (watcher.settings.width, watcher.settings.height), watcher.plant.model
    for number, posture in enumerate(postures):
        if not _carry(watcher, parts, posture):
            continue
        here = watcher.plant.q
        for gaze in gaze_postures(watcher.rig, model, carried, here, share, size, looks, rng):
            lesson = _look(watcher, carried, gaze, number)
            if lesson is not None:
                found.append(lesson)
    return found


def _carry(watcher: Watcher, parts: Sequence[str], posture: Array) -> bool:
    """Move the teacher to a posture; returns whether it has arrived."""
    for _ in range(MOTIONS):
        watcher.move(posture, parts, 0.0)
        off = np.abs(watcher.plant.q - posture)
        if all(float(off[watcher.rig.robot.part(part).slice].max()) < ARRIVED for part in parts):
            return True
    return False


def _look(watcher: Watcher, carried: Carried, gaze: Array, number: int) -> Lesson | None:
    rig = watcher.rig
    motion, arrived = watcher.move(gaze, PARTS, REST + PERIOD)
    t = arrived + REST
    true = carried.place(rig, link_transforms(rig.robot, motion.true_at(t)))
    watcher.scene.place(BALL, true, np.array([1.0, 0.0, 0.0, 0.0]))
    moment, pictures = watcher.look(motion, t)
    balls = {name: find_balls(picture, rig.lens.matrix, rig.lens.distortion) for name, picture in pictures.items()}
    if not all(balls.values()):
        return None
    largest = [some[0] for some in balls.values()]  # things of the room are smaller than a ball within reach
    sizes = [one.half_angle for one in largest]
    if max(sizes) > ALIKE * min(sizes):
        return None
    pixels = np.array([rig.lens.project(one.direction) for one in largest])
    return Lesson(pixels, moment, carried.place(rig, link_transforms(rig.robot, moment.q)), true, number)
