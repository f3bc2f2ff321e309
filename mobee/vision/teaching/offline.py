# SPDX-License-Identifier: Apache-2.0
"""Teaches a simulated robot to locate a ball: another robot carries it from place to place; the learner sees it from random postures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.vision.ball import find_balls
from mobee.vision.calibration.offline import PERIOD, Watcher
from mobee.vision.teaching.lessons import PARTS, Lesson
from mobee.vision.teaching.postures import Carried, gaze_postures

ARRIVED = 0.1  # rad, of the teacher from its posture: beyond it, something was in its way
MOTIONS = 3  # of the time that `Watcher.move` takes at most, until the teacher gives up
REST = 0.1  # s after the robots have arrived
ALIKE = 1.35  # ratio of the ball's sizes in the two pictures, at most
BALL = "ball"  # the name of the world's object that is shown


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
