"""The same actions of an arm with PyBullet and with the offline plant, under the same controller and the same encoder noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from experiments.identify.body import make_body
from experiments.identify.fitting import Fit
from experiments.identify.report import encoder_noise
from experiments.identify.signals import DT
from mobee import Controller, Gains, Model, MotorParameters, OfflinePlant, World
from mobee.robot.robot import Array, Robot
from services.robot_sim.backend import Backend

PART = "left_arm"
ACTION = 300  # ticks an action, for the default gains have a time constant of 0.4 s
MIDDLE = (0.25, 0.75)  # share of the motors' ranges from which targets are drawn
WRIST = slice(0, 7)  # the motors of the arm that are sent somewhere; the fingers stay


class BodyPlant:
    """What `OfflinePlant.tick` does, with another body: a command formed in a tick moves it in the next."""

    def __init__(self, model: Model, body: Backend) -> None:
        self.controller = Controller(model, Gains.default())
        self._model, self._body, self._k = model, body, 0
        self._command: Array | None = None

    def tick(self) -> Array:
        """The encoders of this tick (n,) rad."""
        self._k += 1
        q = self._body.motors.encoders(self._k, DT)
        if self._command is not None:
            self._body.motors.command(slice(None), "velocity", self._command)
        self._command = self.controller.step(q, DT, self.controller.forces(self._model.evaluate(q))).velocity
        self._body.step(DT)
        return q


def reproduce(robot: Robot, fit: Fit, actions: int, seed: int) -> dict[str, Any]:
    """How far the offline plant is from PyBullet with the motors identified, published and ideal, deg."""
    model = Model(robot, World())
    targets = free_targets(model, actions, np.random.default_rng([seed, 3]))

    def bullet(noise_seed: int) -> Array:
        plant = BodyPlant(model, make_body(robot, noise_seed))
        return _trajectory(plant.tick, plant.controller, targets)

    def offline(motors: MotorParameters) -> Array:
        plant = OfflinePlant(model, seed, Gains.default(), motors, DT)

        def tick() -> Array:
            plant.tick()
            return plant.measure(PART)

        return _trajectory(tick, plant.controller, targets)

    there = robot.part(PART).slice
    reference = bullet(seed)[:, :, there]
    identified = identified_motors(fit)
    noise = identified.encoder_noise
    ideal = MotorParameters(lag=0.0, delay=0.0, backlash=0.0, encoder_noise=noise)
    others = {"identified": identified, "published": MotorParameters(), "ideal": ideal}
    found = {name: _difference(offline(motors) - reference) for name, motors in others.items()}
    return {**found, "pybullet_with_other_noise": _difference(bullet(seed + 1)[:, :, there] - reference)}


def identified_motors(fit: Fit) -> MotorParameters:
    """The fitted numbers, as a plant takes them."""
    p = fit.parameters
    return MotorParameters(lag=p.lag, delay=p.delay, backlash=p.backlash, friction=p.friction, encoder_noise=encoder_noise(fit))


def free_targets(model: Model, count: int, rng: np.random.Generator) -> Array:
    """Targets of the arm, (count, n_part) rad, at which nothing of the robot is in a field of another."""
    robot, part = model.robot, model.robot.part(PART)
    low, high = robot.limits[part.slice][WRIST].T
    targets: list[Array] = []
    while len(targets) < count:
        q = robot.home.copy()
        target = q[part.slice]
        target[WRIST] = low + (high - low) * rng.uniform(*MIDDLE, len(low))
        if not model.evaluate(q).contacts:
            targets.append(target)
    return np.array(targets)


def _trajectory(tick: Callable[[], Array], controller: Controller, targets: Array) -> Array:
    """(actions, ticks, ...) rad."""
    courses = []
    for target in targets:
        controller.set_attractor(PART, target)
        courses.append([tick() for _ in range(ACTION)])
    return np.array(courses)


def _difference(course: Array) -> dict[str, float]:
    """Of (actions, ticks, n_part) rad, in degrees."""
    moved = np.rad2deg(course[..., WRIST])
    ends = np.abs(moved[:, -20:].mean(axis=1))  # the noise that the two do not share must not count
    return {
        "rms_deg": float(np.sqrt(np.square(moved).mean())),
        "largest_deg": float(np.abs(moved).max()),
        "end_deg": float(ends.mean()),
        "largest_end_deg": float(ends.max()),
    }
