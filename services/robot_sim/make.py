# SPDX-License-Identifier: Apache-2.0
"""Makes the back-end of the simulator (motor model alone, PyBullet or MuJoCo) that the configuration names."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import partial
from pathlib import Path

from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.choice import EXTRA, choose
from services.robot_sim.config import Config
from services.robot_sim.kinematic import Backend, BackendUnavailable, KinematicBackend
from services.robot_sim.strength import with_torques
from services.robot_sim.watch import Recorded


def make_backend(config: Config, robot: Robot) -> Backend:
    """Return the back-end of the simulator (motor model alone, PyBullet or MuJoCo) that the configuration names.

    If the setting `record` names a folder, the back-end also writes the true joint positions and the contacts of every tick there. Raises
    BackendUnavailable if the back-end is not installed or cannot simulate the robot, and MobeeError if a setting of the motors, the world
    or the folder is invalid.
    """
    backend = _make_backend(config, robot)
    return Recorded(backend, Path(config.record)) if config.record else backend


def motor_parameters(config: Config, robot: Robot) -> MotorParameters:
    """Return the parameters of the simulated motors, as the configuration sets them.

    With `motors` = "identified" they are those that were fitted to the responses of this robot (docs/plant.md). In this case UnknownName is
    raised for a robot without such parameters.
    """
    if config.motors == "identified":
        return replace(MotorParameters.identified(robot.name), substep=config.substep)
    return MotorParameters(
        lag=config.lag,
        delay=config.delay,
        backlash=config.backlash,
        friction=config.friction,
        encoder_noise=config.encoder_noise,
        substep=config.substep,
    )


def _make_backend(config: Config, robot: Robot) -> Backend:
    parameters, robot = motor_parameters(config, robot), with_torques(robot, config.torques)
    chosen, dt = choose(config.backend, robot).name, round(1e9 / config.rate) / 1e9
    load_world = partial(copy, config.load_world())  # once: a reset restores it, although its file may have changed
    if chosen == "kinematic":
        return KinematicBackend(robot, load_world, parameters, config.seed)
    try:
        if chosen == "mujoco":
            from services.robot_sim.mujoco_backend import MujocoBackend  # optional, as PyBullet

            return MujocoBackend(robot, load_world, parameters, config.seed, dt)
        from services.robot_sim.bullet import BulletBackend  # which not every Python has

        return BulletBackend(robot, load_world, parameters, config.seed, dt)
    except ModuleNotFoundError as error:
        raise BackendUnavailable(
            f'backend = "{chosen}" needs the module {error.name!r}: pip install "mobee[{EXTRA}]". Without it: backend = "kinematic".'
        ) from error
