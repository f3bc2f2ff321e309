# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.errors import UnknownName
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.config import Config
from services.robot_sim.make import make_backend


def test_the_default_motors_are_those_of_the_offline_plant() -> None:
    backend = make_backend(Config(backend="kinematic"), load_robot("icub"))
    given, expected = backend.motors.parameters, MotorParameters()
    for name in MotorParameters.__dataclass_fields__:
        assert np.isclose(getattr(given, name), getattr(expected, name), rtol=1e-12), name


def test_identified_motors_are_those_of_the_offline_plant() -> None:
    backend = make_backend(Config(backend="kinematic", motors="identified", substep=0.002, lag=0.3), load_robot("icub"))
    assert backend.motors.parameters == replace(MotorParameters.identified("icub"), substep=0.002)


def test_a_robot_whose_motors_were_not_identified_is_refused() -> None:
    with pytest.raises(UnknownName, match="identified robot"):
        make_backend(Config(backend="kinematic", motors="identified"), load_robot("katana"))
