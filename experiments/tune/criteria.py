"""What gains are judged by, and the one number that the search makes smaller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from experiments.control.arm_command import Command, random_command
from experiments.control.arm_try import try_commands
from experiments.control.depths import deepest
from experiments.control.models import icub_at_table
from experiments.control.ride import ride
from experiments.control.row import Row
from experiments.control.steps import judge, motor_step, postures, step_ride
from experiments.control.walls import WALLS
from experiments.tune.press import press, targets
from mobee import Gains
from mobee.robot.robot import Array
from mobee.simulation import OfflinePlant

STEPPED = ("torso_yaw", "torso_pitch", "l_shoulder_pitch", "l_shoulder_roll", "l_elbow", "l_wrist_prosup", "neck_yaw")
POSTURES, TARGETS, COMMANDS = 4, 10, 40
AGES = (1, 3, 4)  # ticks of 10 ms; the last is one more than must be stable
SHOVED = ("table-left-hand", "table-both-hands", "table-edge", "chest", "face", "other-hand")
STRONG, PUSHED = 300.0, 3.0  # N/kg before the squash; s
WANDERS, WANDER, HOLD = 6, 60.0, 6.0  # how many; s each; s a target, in the joint box
AT_ENDS = 0.5  # of the motors' targets are an end of the range, where the springs of many motors push together
SPEEDS = (1.0, 0.2)  # speed scales, in turn; the thesis' robot ran at 0.1 and 0.2
WANDERING = ("torso", "head", "left_arm", "right_arm")  # without the fingers: the 23 motors of thesis 4.1.1
FINGERS = 7  # the first of them in an arm


@dataclass(frozen=True, slots=True)
class Judged(Row):
    """The criteria, of the joints' true positions."""

    settling_s: float  # median of steps of motors and postures
    overshoot: float  # the largest of a motor's step; what a contact deflects on its way to a posture is none
    solid_mm: float  # deepest, pressing, at the ages that must be stable, and wandering
    field_mm: float  # deepest, pressing
    pushed_mm: float  # deepest solid while a client pushes with all that it may
    chatter_mm: float  # pressing, mean over the postures, 1 tick of age
    late_mm: float  # the same, 3 ticks
    later_mm: float  # the same, 4 ticks
    clause_deg: float  # largest violation, negative inside
    forced_deg: float  # the same while a client pushes
    stop_deg_s: float  # fastest arrival at a hard stop without a push
    longest_ms: float  # the control period at which the law stops being stable


# What is asked, and what a unit of falling short costs; a second of settling time costs 1.
WANTED: Mapping[str, tuple[float, float]] = {
    "overshoot": (0.02, 20.0),
    "solid_mm": (1.0, 1.0),
    "field_mm": (45.0, 0.02),
    "pushed_mm": (0.0, 0.5),
    "chatter_mm": (1.0, 0.3),
    "late_mm": (1.5, 0.3),
    "later_mm": (3.0, 0.1),
    "clause_deg": (-1.0, 1.0),
    "forced_deg": (0.0, 0.5),
    "stop_deg_s": (0.0, 0.05),
}
SHORTEST_LONGEST = 25.0  # ms; a period of 20 must be possible


def objective(judged: Judged) -> float:
    """Settling time [s] plus what is wrong; less is better."""
    cost = judged.settling_s + 0.2 * max(0.0, SHORTEST_LONGEST - judged.longest_ms)
    for name, (wanted, price) in WANTED.items():
        cost += price * max(0.0, getattr(judged, name) - wanted)
    return cost


def evaluate(gains: Gains) -> Judged:
    """Judge gains; always the same seeds, so that two of them can be compared."""
    settling, overshoot = _steps(gains)
    pressed = {age: [press(gains, target, age) for target in _targets()] for age in AGES}
    must_hold = [p for age in AGES[:2] for p in pressed[age]]
    chatter = {age: 1e3 * float(np.mean([p.chatter for p in pressed[age]])) for age in AGES}
    clause, stop = _clauses(gains, forced=False)
    wandered = max(_wander(gains, seed) for seed in range(WANDERS))
    return Judged(
        settling,
        overshoot,
        solid_mm=1e3 * max(wandered, *(p.solid for p in must_hold)),
        field_mm=1e3 * max(p.field for p in must_hold),
        pushed_mm=1e3 * max(_pushed(gains, wall) for wall in SHOVED),
        chatter_mm=chatter[1],
        late_mm=chatter[3],
        later_mm=chatter[4],
        clause_deg=clause,
        forced_deg=_clauses(gains, forced=True)[0],
        stop_deg_s=stop,
        longest_ms=1e3 * OfflinePlant(icub_at_table(), gains=gains, dt=1e-3).controller.max_dt,
    )


def _steps(gains: Gains) -> tuple[float, float]:
    robot, home = icub_at_table().robot, icub_at_table().robot.home
    steps = [motor_step(robot.motors.index(motor)) for motor in STEPPED] + [(home, target) for target in _postures()]
    responses = [judge(step_ride(gains, 10.0, *step, seed=i), *step) for i, step in enumerate(steps)]
    return float(np.median([r.settling for r in responses])), max(r.overshoot for r in responses[: len(STEPPED)])


def _wander(gains: Gains, seed: int) -> float:
    """The deepest solid [m] on the way between random postures, with whatever is between them."""
    robot, rng = icub_at_table().robot, np.random.default_rng(seed)
    plant = OfflinePlant(icub_at_table(), seed, gains, speed_scale=SPEEDS[seed % len(SPEEDS)])
    moving = np.concatenate([np.arange(len(robot.motors))[robot.parts[part].slice][:FINGERS] for part in WANDERING])
    found = 0.0
    for _ in range(round(WANDER / HOLD)):
        attractor = plant.controller.attractor
        levels = rng.uniform(0.0, 1.0, len(moving))
        levels = np.where(rng.random(len(moving)) < AT_ENDS, levels.round(), levels)
        low, high = robot.limits[moving].T
        attractor[moving] = low + levels * (high - low)
        plant.controller.attractor = attractor
        found = max(found, deepest(icub_at_table(), ride(plant, HOLD).q[::2]).solid)
    return found


def _pushed(gains: Gains, wall: str) -> float:
    plant = OfflinePlant(icub_at_table(), 0, gains)
    WALLS[wall](plant.controller, STRONG)
    return deepest(icub_at_table(), ride(plant, PUSHED).q[::2]).solid


def _clauses(gains: Gains, forced: bool) -> tuple[float, float]:
    trials = [try_commands(gains, commands, np.zeros(3), seed) for seed, commands in enumerate(_commands(forced))]
    return float(np.rad2deg(max(t.violations.max() for t in trials))), float(np.rad2deg(max(t.stop.max() for t in trials)))


@lru_cache(maxsize=1)
def _targets() -> list[Array]:
    return targets(TARGETS)


@lru_cache(maxsize=1)
def _postures() -> list[Array]:
    return postures(POSTURES, 0)


@lru_cache(maxsize=2)
def _commands(forced: bool) -> list[tuple[Command, Command]]:
    rng = np.random.default_rng(0)
    return [(random_command(rng, forced), random_command(rng, forced)) for _ in range(COMMANDS)]
