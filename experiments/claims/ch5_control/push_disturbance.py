# SPDX-License-Identifier: Apache-2.0
"""Push disturbance: an external force at the robot's hand, against which MoBeE gives no guarantee.

Claim: MoBeE protects the robot from itself, not from external energy (thesis 5.2, footnote 4: Justin "can sense when there is too much
energy in the system ... and apply brakes"; MoBeE has "no such emergency stop").  Measured here: the forces at the hand from which solids
touch, a constraint is violated or a motor is driven into its stop, and whether the robot returns afterwards.  Source: thesis 5.2, footnote
4.  Published: no numbers.  Run time: a minute.

A force acts at the left hand for 0.4 s while the controller holds the posture.  It moves the joints through J^T and the inertia and
friction of the motors (those of the torque modality); the controller senses only the joint positions.  With MoBeE off, the same force
acts on a robot that does not react.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.kit.control.plant_runs import COLORS, PERIOD, icub_at_table, run_plant
from experiments.kit.control.safety import AT_STOP, clause_violations, deepest, limit_violations, speeds_at_stops
from experiments.kit.experiment import Experiment
from experiments.kit.plots import new_figure
from experiments.kit.records import Row
from experiments.kit.sweep import Cells, Condition, Sweep, grid
from mobee import Gains
from mobee.arrays import Array
from mobee.control.law import FRICTION, INERTIA
from mobee.simulation import OfflinePlant

MARKER = "left_palm"
LAWS = ("default", "published_2014", "off")
FORCES = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # N
QUICK_FORCES = FORCES[1::2]
BEFORE, PUSH, AFTER = 1.0, 0.4, 6.0  # s
DIRECTIONS = {  # root frame: x backwards, y right, z up
    "down-to-table": (0.0, 0.0, -1.0),
    "back-to-body": (1.0, 0.0, 0.0),
    "inward-to-other-hand": (0.0, 1.0, 0.0),
    "up-to-face": (0.5, 0.4, 0.75),
    "outward": (0.0, -1.0, 0.0),
}
RETURNED = 5.0  # mm, allowed distance of the hand from its start after the push
GENTLE = 5.0  # N: with the default gains nothing may touch up to this force

PANELS = (("moved_mm", "the hand moved [mm]"), ("solid_mm", "deepest solid [mm]"), ("away_mm", "the hand stayed away [mm]"))


@dataclass(frozen=True, slots=True)
class PushResult(Row):
    """The worst measures during and after a push; the angle is negative inside."""

    law: str
    direction: str
    force: float  # N
    moved_mm: float  # largest distance of the hand from its start
    solid_mm: float
    beside_mm: float  # solid pairs that are not listed
    field_mm: float
    clause_deg: float
    stop_deg_s: float  # fastest impact at a hard stop
    away_mm: float  # distance of the hand from its start, at the end
    pair: str  # of solids, the deepest


class ExternalPush:
    """Moves the joints of a plant: inertia dv/dt = J^T f - friction v, as motors yield in the torque modality."""

    def __init__(self, plant: OfflinePlant, force: Array, start: float, end: float) -> None:
        self._plant, self._force = plant, force
        self._ticks = range(round(start / plant.dt), round(end / plant.dt))
        self._velocity = np.zeros(len(plant.robot.motors))

    def __call__(self, tick: int) -> None:
        """Move the joints before a tick."""
        plant = self._plant
        torque = plant.model.jacobian(plant.motors.q, MARKER)[:3].T @ self._force if tick in self._ticks else 0.0
        # The exact solution over one tick: at 20 ms the friction is stiff.
        decay = np.exp(-FRICTION / INERTIA * plant.dt)
        self._velocity = decay * self._velocity + (1.0 - decay) * torque / FRICTION
        if self._velocity.any():
            plant.motors.adopt((plant.motors.q + self._velocity * plant.dt).clip(*plant.robot.limits.T))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add laws and directions."""
    choices = tuple(DIRECTIONS)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS), metavar="LAW", help=f"of {', '.join(LAWS)}")
    parser.add_argument("--directions", nargs="+", choices=choices, default=list(choices), metavar="WHERE", help=f"of {', '.join(choices)}")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return every law, direction and force."""
    return grid(law=arguments.laws, direction=arguments.directions, force=QUICK_FORCES if arguments.quick else FORCES)


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Push once and measure."""
    return push_hand(settings["law"], settings["direction"], settings["force"], seed).record()


def push_hand(law: str, direction: str, force: float, seed: int) -> PushResult:
    """Hold home while the hand is pushed; law "off": the commanded velocity is always 0."""
    gains = Gains.named("default" if law == "off" else law)
    if law == "off":
        gains = replace(gains, weights=(("*", 0.0),))
    plant = OfflinePlant(icub_at_table(), seed, gains, dt=PERIOD[gains.law])
    push = force * np.array(DIRECTIONS[direction]) / np.linalg.norm(DIRECTIONS[direction])
    home = plant.robot.home
    run = run_plant(plant, BEFORE + PUSH + AFTER, ExternalPush(plant, push, BEFORE, BEFORE + PUSH))
    hand = icub_at_table().evaluate(run.q).position(MARKER)
    start = hand[round(BEFORE / plant.dt) - 1]
    away = np.linalg.norm(hand - start, axis=1)
    depths = deepest(icub_at_table(), run.q)
    inside = limit_violations(plant.robot, home[None])[0] < -AT_STOP
    return PushResult(
        law,
        direction,
        force,
        1e3 * float(away.max()),
        1e3 * depths.solid,
        1e3 * depths.beside,
        1e3 * depths.field,
        float(np.rad2deg(clause_violations(plant.robot, run.q).max())),
        float(np.rad2deg(np.abs(speeds_at_stops(plant.robot, run, home)[:, inside]).max())),
        1e3 * float(away[-1]),
        depths.pair,
    )


def findings(found: Cells) -> dict[str, Any]:
    """Return for each law and direction the least force at which each event occurred; None if it did not occur."""
    results = _results(found)
    table = {
        law: {direction: _summary(mine) for direction in DIRECTIONS if (mine := _of(results, law, direction))}
        for law in LAWS
        if any(one.law == law for one in results)
    }
    judged = [one for one in results if one.law == "default" and one.force <= GENTLE]
    passed = all(one.solid_mm == 0.0 and one.clause_deg <= 0.0 and one.away_mm <= RETURNED for one in judged)
    return {"passed": passed if judged else None, **table}  # the claim is about the default gains


def _summary(results: Sequence[PushResult]) -> dict[str, Any]:
    """Summarise the pushes of one law and direction."""
    return {
        "solids_touch_from_N": next((one.force for one in results if one.solid_mm > 0.0), None),
        "constraint_violated_from_N": next((one.force for one in results if one.clause_deg > 0.0), None),
        "motor_into_its_stop_from_N": next((one.force for one in results if one.stop_deg_s > 0.0), None),
        "deepest_solid_mm": max(one.solid_mm for one in results),
        "back_within_mm": max((one.away_mm for one in results if one.force <= GENTLE), default=0.0),
    }


def _results(found: Cells) -> list[PushResult]:
    return [PushResult(**result.values) for result in found.values()]


def _of(results: Iterable[PushResult], law: str, direction: str) -> list[PushResult]:
    return sorted((one for one in results if (one.law, one.direction) == (law, direction)), key=lambda one: one.force)


def plot(found: Cells) -> Any:
    """Draw distances and depths against the force, a column for each direction."""
    results = _results(found)
    directions = [name for name in DIRECTIONS if any(one.direction == name for one in results)]
    drawing = new_figure(3.0 * len(directions), 7.0)
    panels = drawing.subplots(len(PANELS), len(directions), squeeze=False, sharex=True, sharey="row")
    for row, (quantity, label) in enumerate(PANELS):
        for axes, direction in zip(panels[row], directions, strict=True):
            for law, color in {**COLORS, "off": "0.5"}.items():
                mine = _of(results, law, direction)
                forces, values = [one.force for one in mine], [getattr(one, quantity) for one in mine]
                axes.plot(forces, values, ".-", color=color, label=law if law != "off" else "no MoBeE")
            axes.grid(alpha=0.2)
            axes.set_xscale("log")
            axes.minorticks_off()
            axes.set_xticks(FORCES, [f"{force:g}" for force in FORCES], fontsize=8)
        panels[row, 0].set_ylabel(label)
    for axes, direction in zip(panels[0], directions, strict=True):
        axes.set_title(direction.replace("-", " "), fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("force at the hand for 0.4 s [N]")
    panels[0, 0].legend(fontsize=7)
    return drawing


EXPERIMENT = Experiment(
    claim="MoBeE yields to a push and returns, but external energy can drive it into contact",
    source="thesis 5.2, footnote 4",
    method=Sweep(conditions, trial, findings, plot, seeds=1, add_options=add_options),
)
