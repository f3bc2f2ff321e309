"""What a user of an own robot meets: what touches at home, where it drifts, where its slides come to rest, how long it takes."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from mobee import CuriousAgent, Lattice, Model, OfflinePlant, load_robot
from mobee.arrays import Array
from mobee.check.touching import leave_out_touching
from mobee.robot.motor_units import slides
from mobee.robot.robot import Robot

HOME_TIME = 10.0  # s
ACTIONS = 250
SHARES = (0.05, 0.275, 0.5, 0.725, 0.95, 0.5, 0.05)  # of a slide's range
JOINTS = 4  # of an arm
FIELD = 0.03  # m


@dataclass(frozen=True, slots=True)
class Measured:
    """One robot; lengths in mm, angles in deg, times in s, -1 where there is nothing to measure."""

    robot: str
    motors: int
    slides: int
    shapes: int
    touching: int  # solid contacts at home
    written: int  # pairs written
    touching_after: int
    srdf_s: float
    drift_deg: float
    drift_mm: float
    slide_mm: float  # the worst error of a slide over SHARES
    unsettled: int  # actions of slides that ended by timeout
    actions_s: float  # from the file to the end of ACTIONS curious actions
    solid: int  # of these actions, those that ended with solids in contact
    field_drift_deg: float  # the same with fields of FIELD
    field_actions_s: float
    field_solid: int

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Names of the fields."""
        return tuple(field.name for field in fields(cls))

    @classmethod
    def of_record(cls, row: dict[str, str]) -> Measured:
        """From the texts of a CSV file."""
        kinds = {"str": str, "int": int, "float": float}
        return cls(**{field.name: kinds[str(field.type)](row[field.name]) for field in fields(cls)})

    def record(self) -> dict[str, Any]:
        """For a CSV file."""
        return {name: round(value, 4) if isinstance(value, float) else value for name, value in asdict(self).items()}


def measure(name: str, urdf: Path, folder: Path, seed: int) -> Measured:
    """Try a robot; its SRDF is written into the folder."""
    robot = load_robot(urdf)
    before = Model(robot).evaluate(robot.home)
    start = time.perf_counter()
    done = leave_out_touching(urdf, folder / f"{name.replace(' ', '_')}.srdf")
    srdf_s = time.perf_counter() - start
    robot = load_robot(urdf, srdf=done.path)
    model = Model(robot)
    drift = _drift(model, seed)
    sliding = np.array([slides(robot, motor) for motor in robot.motor_table])
    found = [_slide(model, int(i), seed) for i in np.flatnonzero(sliding)]
    actions_s, solid = _explore(urdf, done.path, None, seed)
    field_drift = _drift(Model(load_robot(urdf, srdf=done.path, field=FIELD)), seed)
    field_actions_s, field_solid = _explore(urdf, done.path, FIELD, seed)
    return Measured(
        robot=name,
        motors=len(robot.motors),
        slides=int(sliding.sum()),
        shapes=len(robot.shapes),
        touching=int(before.count),
        written=len(done.pairs),
        touching_after=done.touching,
        srdf_s=srdf_s,
        drift_deg=_degrees(drift[~sliding]),
        drift_mm=float(1e3 * drift[sliding].max()) if sliding.any() else -1.0,
        slide_mm=max((1e3 * worst for worst, _ in found), default=-1.0),
        unsettled=sum(late for _, late in found),
        actions_s=actions_s,
        solid=solid,
        field_drift_deg=_degrees(field_drift[~sliding]),
        field_actions_s=field_actions_s,
        field_solid=field_solid,
    )


def _degrees(drift: Array) -> float:
    return float(np.rad2deg(drift.max())) if len(drift) else -1.0


def _drift(model: Model, seed: int) -> Array:
    """How far each motor is from home (n,) after a while with home as its attractor, at most, in its unit."""
    plant = OfflinePlant(model, seed)
    plant.controller.attractor = model.robot.home
    trace = plant.run(round(HOME_TIME / plant.dt))
    most: Array = np.abs(trace.q - model.robot.home).max(axis=0)
    return most


def _slide(model: Model, index: int, seed: int) -> tuple[float, int]:
    """The worst error [m] of a slide that is sent through its range, the rest at home; and how often it timed out."""
    motor = model.robot.motor_table[index]
    part = model.robot.part(motor.part)
    plant, target = OfflinePlant(model, seed), model.robot.home[part.slice].copy()
    worst, late = 0.0, 0
    for share in SHARES:
        target[index - part.start] = motor.limits[0] + share * np.ptp(motor.limits)
        outcome = plant.act(motor.part, target)
        wrong = abs(outcome.q - target)[index - part.start], abs(plant.motors.q[part.slice] - target)[index - part.start]
        worst, late = max(worst, *map(float, wrong)), late + (not outcome.settled)
    return worst, late


def arm_of(robot: Robot) -> list[str]:
    """Up to JOINTS motors of one part that turn: those of the longest chain from the base on, then others of its part."""
    chains: list[list[int]] = [[]]
    drive = {joint: k for k, motor in enumerate(robot.motor_table) for joint, _, _ in motor.joints}
    for index, joint in enumerate(robot.joints):
        chains.append([*chains[joint.parent], *([drive[index]] if index in drive else [])])
    turning = [k for k, motor in enumerate(robot.motor_table) if not slides(robot, motor)]
    best: list[int] = []
    for chain in sorted(chains, key=len, reverse=True)[:20]:
        for part in robot.parts.values():
            mine = [k for k in dict.fromkeys(chain) if k in turning and part.slice.start <= k < part.slice.stop]
            best = mine if len(mine) > len(best) else best
    part = robot.part(robot.motor_table[best[0]].part)
    more = [k for k in turning if part.slice.start <= k < part.slice.stop and k not in best]
    return [robot.motors[k] for k in [*best, *more][:JOINTS]]


def _explore(urdf: Path, srdf: Path, field: float | None, seed: int) -> tuple[float, int]:
    """Seconds from the file to the end of ACTIONS curious actions, and after how many of them solids touched."""
    start = time.perf_counter()
    robot = load_robot(urdf, srdf=srdf, field=field)
    plant = OfflinePlant(Model(robot), seed)
    agent = CuriousAgent(Lattice(robot, arm_of(robot)), plant, seed=seed)
    seconds, solid = 0.0, 0
    for _ in range(ACTIONS):
        agent.step()
        seconds += time.perf_counter() - start
        pose = plant.pose
        solid += pose is not None and bool(pose.count)
        start = time.perf_counter()
    return seconds, solid
