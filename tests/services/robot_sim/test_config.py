from __future__ import annotations

import numpy as np

from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.config import Config
from services.robot_sim.make import make_backend


def test_the_default_motors_are_those_of_the_offline_plant() -> None:
    backend = make_backend(Config(backend="kinematic"), load_robot("icub"))
    given, expected = backend.motors.parameters, MotorParameters()
    for name in MotorParameters.__dataclass_fields__:
        assert np.isclose(getattr(given, name), getattr(expected, name), rtol=1e-12), name
