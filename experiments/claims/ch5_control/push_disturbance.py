# SPDX-License-Identifier: Apache-2.0
"""Push disturbance: an external force at the robot's hand, against which MoBeE gives no guarantee.

Claim: MoBeE protects the robot from itself, not from external energy (thesis 5.2, footnote 4: the robot Justin "can sense when there is too
much energy in the system ... and apply brakes"; MoBeE has "no such emergency stop").  Measured here: the smallest forces at the hand with
which solid shapes touch, a constraint is violated, or a motor is driven into its stop, and whether the robot returns afterwards.
Source: thesis 5.2, footnote 4.  Published: no numbers.  Run time: a minute.

A force acts at the left hand for 0.4 s while the controller holds the posture.  The force causes joint torques through J^T, which move the
motors against inertia and friction.  Inertia and friction have the values of torque-controlled motors.  The controller senses only the
joint positions.  With MoBeE off, the same force acts on a robot that does not react.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.control.measures import AT_STOP, clause_violations, deepest, limit_violations, speeds_at_stops
from experiments.kit.control.plant_runs import COLORS, PERIOD, icub_at_table, run_plant
from experiments.kit.experiment import Experiment
from experiments.kit.plots import new_figure
from experiments.kit.run_folder import rounded
from experiments.kit.sweep import Cells, Condition, Sweep, grid, grouped_by
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


class ExternalPush:
    """A constant external force at the left hand that moves the joints of a plant; call it with the tick number before each tick.

    In addition to its commanded motion, each motor moves by I dv/dt = tau - b v: tau = J^T f is the torque of the force [N m], v the
    velocity [rad/s], I the inertia INERTIA (0.5 kg m^2), b the friction FRICTION (5 N m s/rad).  The values are those of motors to which
    the controller sends torques.  Positions are clipped to the limits.

    Args:
        plant: the plant.
        force: (3,) N, root frame.
        start, end: times of the plant [s] between which the force acts.
    """

    def __init__(self, plant: OfflinePlant, force: Array, start: float, end: float) -> None:
        self._plant, self._force = plant, force
        self._ticks = range(round(start / plant.dt), round(end / plant.dt))
        self._velocity = np.zeros(len(plant.robot.motors))

    def __call__(self, tick: int) -> None:
        """Move the joints by the external force for one tick; `tick`: number of the tick that begins."""
        plant = self._plant
        torque = plant.model.jacobian(plant.motors.q, MARKER)[:3].T @ self._force if tick in self._ticks else 0.0
        # The exact solution over one tick: at 20 ms the friction is stiff.
        decay = np.exp(-FRICTION / INERTIA * plant.dt)
        self._velocity = decay * self._velocity + (1.0 - decay) * torque / FRICTION
        if self._velocity.any():
            plant.motors.adopt((plant.motors.q + self._velocity * plant.dt).clip(*plant.robot.limits.T))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --laws and --directions to the parser."""
    choices = tuple(DIRECTIONS)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS), metavar="LAW", help=f"of {', '.join(LAWS)}")
    parser.add_argument("--directions", nargs="+", choices=choices, default=list(choices), metavar="WHERE", help=f"of {', '.join(choices)}")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the conditions of the sweep: every control law (gain set, or "off"), direction and force."""
    return grid(law=arguments.laws, direction=arguments.directions, force=QUICK_FORCES if arguments.quick else FORCES)


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Push the left hand of the robot once, and return the worst measurements by name, as in `push_hand`.

    `settings`: "law", one of LAWS; "direction"; "force" [N].  `seed`: of the plant.
    """
    return push_hand(settings["law"], settings["direction"], settings["force"], seed)


def push_hand(law: str, direction: str, force: float, seed: int) -> dict[str, Any]:
    """Command home while an external force pushes the left hand, and return the worst measurements.

    `law`: name of the gain set, or "off": the commanded velocity is always 0.  `direction`: a key of DIRECTIONS.  `force`: N.  `seed`: of
    the plant.

    Keys: "moved_mm" and "away_mm", largest and last distance of the hand from its start; "solid_mm", depth of the deepest contact of two
    solid shapes, among the pairs of shapes that the simulator tests too; "pair", the names of these two shapes; "beside_mm", the same depth
    among all other pairs of solid shapes; "field_mm", depth of the deepest contact of fields, larger volumes that cause repulsive forces;
    "clause_deg", largest violation of a constraint [degrees], negative if none is violated; "stop_deg_s", fastest impact at a hard stop
    [degrees/s].
    """
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
    return rounded(
        law=law,
        direction=direction,
        force=force,
        moved_mm=1e3 * float(away.max()),
        solid_mm=1e3 * depths.solid,
        beside_mm=1e3 * depths.beside,
        field_mm=1e3 * depths.field,
        clause_deg=float(np.rad2deg(clause_violations(plant.robot, run.q).max())),
        stop_deg_s=float(np.rad2deg(np.abs(speeds_at_stops(plant.robot, run, home)[:, inside]).max())),
        away_mm=1e3 * float(away[-1]),
        pair=depths.pair,
    )


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with a key for each control law, and the key "passed".

    Under a control law there is a dict from the direction of the push to a dict with the following numbers.  "solids_touch_from_N",
    "constraint_violated_from_N" and "motor_into_its_stop_from_N": smallest force [N] with this event; None if it did not occur.
    "deepest_solid_mm": depth of the deepest solid contact.  "back_within_mm": distance of the hand from its start at the end of a run, the
    largest one after forces of at most 5 N.  "passed": whether with the default gains forces of at most 5 N cause no contact of solids and
    no violation, and the hand returns to within 5 mm; None if these were not run.
    """
    pushes = _pushes(found)
    table = {law: {direction: _summary(mine) for (of, direction), mine in pushes.items() if of == law} for law in LAWS}
    judged = [one for (law, _), mine in pushes.items() for one in mine if law == "default" and one["force"] <= GENTLE]
    passed = all(one["solid_mm"] == 0.0 and one["clause_deg"] <= 0.0 and one["away_mm"] <= RETURNED for one in judged)
    of_laws = {law: summaries for law, summaries in table.items() if summaries}
    return {"passed": passed if judged else None, **of_laws}  # the claim is about the default gains


def _summary(pushes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers that `findings` describes, for the pushes with one control law in one direction.

    `pushes`: results of `push_hand`, in the order of increasing force.
    """

    def least(name: str) -> float | None:
        return next((one["force"] for one in pushes if one[name] > 0.0), None)

    return {
        "solids_touch_from_N": least("solid_mm"),
        "constraint_violated_from_N": least("clause_deg"),
        "motor_into_its_stop_from_N": least("stop_deg_s"),
        "deepest_solid_mm": max(one["solid_mm"] for one in pushes),
        "back_within_mm": max((one["away_mm"] for one in pushes if one["force"] <= GENTLE), default=0.0),
    }


def _pushes(found: Cells) -> dict[tuple[str, str], list[dict[str, Any]]]:
    """Return a dict from (control law, direction) to the results of `push_hand`, sorted by force; pairs without results are absent."""
    groups = grouped_by(found, "law", "direction")
    keys = (key for key in product(LAWS, DIRECTIONS) if key in groups)
    return {key: sorted(groups[key], key=lambda one: float(one["force"])) for key in keys}


def plot(found: Cells) -> Any:
    """Return a figure with the force on the horizontal axis, and a column for each direction.

    The rows are the largest distance of the hand from its start, the depth of the deepest contact of solids, and the hand's last distance.
    """
    pushes = _pushes(found)
    directions = [name for name in DIRECTIONS if any(direction == name for _, direction in pushes)]
    drawing = new_figure(3.0 * len(directions), 7.0)
    panels = drawing.subplots(len(PANELS), len(directions), squeeze=False, sharex=True, sharey="row")
    for row, (quantity, label) in enumerate(PANELS):
        for axes, direction in zip(panels[row], directions, strict=True):
            for law, color in {**COLORS, "off": "0.5"}.items():
                mine = pushes.get((law, direction), [])
                forces, values = [one["force"] for one in mine], [one[quantity] for one in mine]
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
