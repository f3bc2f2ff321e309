"""A hand is drawn to a target by the whole body (thesis 5.1, 8.2; `mobee.Reacher`): does it stop dead, does it oscillate?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.control.depths import oscillation
from experiments.control.models import icub
from experiments.control.ride import PERIOD, place, ride
from experiments.control.row import Row
from mobee import Gains
from mobee.control import Reacher
from mobee.robot.robot import Array
from mobee.simulation import OfflinePlant

MARKER, ARM = "left_palm", "left_arm"
SECONDS = 60.0
REST = 3.0  # s, the end of the ride
# m/s, s, m: slower than this over that time, farther than that from where it comes to rest, the hand has stopped dead.
SLOW, WINDOW, NEAR = 2e-4, 0.5, 0.01


@dataclass(frozen=True, slots=True)
class Drawn(Row):
    """What came of it."""

    gains: str
    target: str
    oscillation_mm: float  # at rest
    dead_s: float  # the longest time without motion before it was at rest
    from_target_mm: float  # at rest


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The hand over time."""

    times: Array  # (T,) s
    place: Array  # (T, 3) m
    target: Array  # (T, 3) m

    def save(self, folder: Path, gains: str, name: str) -> None:
        """For the figure."""
        np.savez_compressed(_file(folder, gains, name), times=self.times, place=self.place, target=self.target)

    @classmethod
    def load(cls, folder: Path, gains: str, name: str) -> Way:
        """What was saved."""
        with np.load(_file(folder, gains, name)) as file:
            return cls(file["times"], file["place"], file["target"])


@dataclass(frozen=True, slots=True)
class Goal:
    """First motors of the left arm at the start [deg], and targets one after the other: from the palm at home [m], root frame."""

    start: tuple[float, ...]
    targets: tuple[tuple[float, float, float], ...]


HOME = (-26.0, 20.0, 0.0, 60.0, 0.0, 0.0, 0.0)
STRETCHED = (-70.0, 30.0, 0.0, 16.0, 0.0, -40.0, 0.0)
ALIGNED = (-26.0, 20.0, 0.0, 60.0, 0.0, 0.0, 0.0)  # the axes of prosup and wrist yaw: at wrist pitch 0
DRAWN = {
    "in-reach": Goal(HOME, ((-0.05, 0.0, 0.15),)),
    "stretched-ahead": Goal(HOME, ((-0.5, 0.0, 0.1),)),
    "stretched-aside": Goal(HOME, ((0.1, -0.6, 0.1),)),
    "stretched-above": Goal(HOME, ((0.0, 0.0, 0.8),)),
    "behind-the-robot": Goal(HOME, ((0.8, -0.1, 0.2),)),
    "out-of-a-stretched-arm": Goal(STRETCHED, ((-0.02, 0.05, 0.05),)),
    "stretched-and-back": Goal(HOME, ((-0.5, 0.0, 0.15), (0.0, 0.0, 0.1))),
    "wrist-axes-aligned": Goal(ALIGNED, ((-0.05, 0.1, 0.1), (-0.05, -0.1, 0.1))),
}


def draw_hand(gains: str, name: str, seed: int) -> tuple[Drawn, Way]:
    """Draw the hand to the targets of a goal, each for its share of the time."""
    goal, robot = DRAWN[name], icub().robot
    plant = OfflinePlant(icub(), seed, Gains.named(gains), dt=PERIOD[gains])
    start = robot.home.copy()
    first = robot.parts[ARM].start
    start[first : first + len(goal.start)] = np.deg2rad(goal.start)
    place(plant, start)
    home = icub().evaluate(robot.home).position(MARKER)
    targets = [home + np.array(target) for target in goal.targets]
    ticks = round(SECONDS / plant.dt / len(targets))

    reacher = Reacher(plant.controller, MARKER, targets[0])

    def pull(tick: int) -> None:
        nonlocal reacher
        q = np.concatenate([plant.measure(part) for part in robot.parts])
        if tick and tick % ticks == 0:
            reacher.stop(q)
            reacher = Reacher(plant.controller, MARKER, targets[tick // ticks])
        reacher.update(q, plant.dt)

    done = ride(plant, ticks * plant.dt * len(targets), pull)
    hand = icub().evaluate(done.q).position(MARKER)
    target = np.repeat(targets, ticks, axis=0)
    dead = max(_dead(hand[i * ticks : (i + 1) * ticks], plant.dt) for i in range(len(targets)))
    restless = oscillation(icub(), done.last(REST), MARKER)
    left = float(np.linalg.norm(hand[-1] - targets[-1]))
    return Drawn(gains, name, 1e3 * restless, dead, 1e3 * left), Way(done.times, hand, target)


def _file(folder: Path, gains: str, name: str) -> Path:
    return folder / f"{gains}-{name}.npz"


def _dead(hand: Array, dt: float) -> float:
    """The longest time [s] in which the hand (T, 3) m was SLOW although NEAR where it ends it was not."""
    window = max(1, round(WINDOW / dt))  # the play of the motors makes single ticks count for nothing
    speed = np.linalg.norm(hand[window:] - hand[:-window], axis=1) / (window * dt)
    stopped = (speed < SLOW) & (np.linalg.norm(hand[:-window] - hand[-1], axis=1) > NEAR)
    begins = np.flatnonzero(stopped & ~np.r_[False, stopped[:-1]])
    ends = np.flatnonzero(stopped & ~np.r_[stopped[1:], False])
    return float((ends - begins + 1).max() * dt) if len(begins) else 0.0
