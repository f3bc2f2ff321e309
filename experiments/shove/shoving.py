"""A force from outside at the hand of the simulated robot."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from experiments.control.depths import deepest
from experiments.control.margins import clause_violations, limit_violations
from experiments.control.models import icub_at_table
from experiments.control.ride import PERIOD, ride
from experiments.control.row import Row
from mobee import Gains
from mobee.control.modality import FRICTION, INERTIA
from mobee.robot.robot import Array
from mobee.simulation import OfflinePlant

MARKER = "left_palm"
LAWS = ("default", "published_2014", "off")
FORCES = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # N
BEFORE, SHOVE, AFTER = 1.0, 0.4, 6.0  # s
AT_STOP = np.deg2rad(0.01)
# Root frame: x backwards, y right, z up.
DIRECTIONS = {
    "down-to-table": (0.0, 0.0, -1.0),
    "back-to-body": (1.0, 0.0, 0.0),
    "inward-to-other-hand": (0.0, 1.0, 0.0),
    "up-to-face": (0.5, 0.4, 0.75),
    "outward": (0.0, -1.0, 0.0),
}


@dataclass(frozen=True, slots=True)
class Shoved(Row):
    """The worst during and after a shove; the angle is negative inside."""

    law: str
    direction: str
    force: float  # N
    moved_mm: float  # how far the hand went
    solid_mm: float
    beside_mm: float  # solids that do not count
    field_mm: float
    clause_deg: float
    stop_deg_s: float  # fastest arrival at a hard stop
    away_mm: float  # of the hand from where it was, at the end
    pair: str  # of solids, the deepest


class Shove:
    """Moves the joints of a plant: inertia dv/dt = J^T f - friction v, as the motors give way in the torque modality."""

    def __init__(self, plant: OfflinePlant, force: Array, start: float, end: float) -> None:
        self._plant, self._force = plant, force
        self._ticks = range(round(start / plant.dt), round(end / plant.dt))
        self._velocity = np.zeros(len(plant.robot.motors))

    def __call__(self, tick: int) -> None:
        """Ahead of a tick."""
        plant = self._plant
        torque = plant.model.jacobian(plant.motors.q, MARKER)[:3].T @ self._force if tick in self._ticks else 0.0
        # Exactly over one tick: the friction is stiff at 20 ms.
        decay = np.exp(-FRICTION / INERTIA * plant.dt)
        self._velocity = decay * self._velocity + (1.0 - decay) * torque / FRICTION
        if self._velocity.any():
            plant.motors.adopt((plant.motors.q + self._velocity * plant.dt).clip(*plant.robot.limits.T))


def shove(law: str, direction: str, force: float, seed: int) -> Shoved:
    """Hold home, be shoved, and see where it ends; law "off": nothing answers, the motors are told to stand still."""
    gains = Gains.named("default" if law == "off" else law)
    if law == "off":
        gains = replace(gains, weights=(("*", 0.0),))
    plant = OfflinePlant(icub_at_table(), seed, gains, dt=PERIOD[gains.law])
    push = force * np.array(DIRECTIONS[direction]) / np.linalg.norm(DIRECTIONS[direction])
    home = plant.robot.home
    done = ride(plant, BEFORE + SHOVE + AFTER, Shove(plant, push, BEFORE, BEFORE + SHOVE))
    hand = icub_at_table().evaluate(done.q).position(MARKER)
    start = hand[round(BEFORE / plant.dt) - 1]
    away = np.linalg.norm(hand - start, axis=1)
    depths = deepest(icub_at_table(), done.q)
    inside = limit_violations(plant.robot, home[None])[0] < -AT_STOP
    arriving = np.diff(done.q, axis=0, prepend=home[None]) / done.dt * (limit_violations(plant.robot, done.q) > -AT_STOP)
    return Shoved(
        law,
        direction,
        force,
        1e3 * float(away.max()),
        1e3 * depths.solid,
        1e3 * depths.beside,
        1e3 * depths.field,
        float(np.rad2deg(clause_violations(plant.robot, done.q).max())),
        float(np.rad2deg(np.abs(arriving[:, inside]).max())),
        1e3 * float(away[-1]),
        depths.pair,
    )
