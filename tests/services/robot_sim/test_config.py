# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from mobee.errors import InvalidValue, UnknownName
from mobee.model.world_file import WORLDS
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.common.config import load_config
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


@pytest.mark.parametrize(
    ("errors", "error", "text"), [({"l_elbo": 0.1}, UnknownName, "l_elbow"), ({"l_elbow": np.inf}, InvalidValue, "finite")]
)
def test_encoder_errors_are_finite_errors_of_motors(errors: dict[str, float], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        Config(backend="kinematic", encoder_errors=errors).check_robot(load_robot("icub"))


@pytest.mark.parametrize("flags", [("--delay", "1e9"), ("--substep", "1e-300")])  # arrays of terabytes, or of a negative size
def test_steps_and_delays_that_no_memory_holds_are_refused(flags: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        load_config(Config, flags, "services.robot_sim")
    assert flags[0].strip("-") in capsys.readouterr().err


@pytest.mark.parametrize("name", ["kinematic", "pybullet", "mujoco"])
def test_a_reset_restores_the_world_of_the_start_although_its_file_has_changed(
    tmp_path: Path, name: Literal["kinematic", "pybullet", "mujoco"]
) -> None:
    if name != "kinematic":
        pytest.importorskip(name)
    world = tmp_path / "world.xml"
    world.write_text((WORLDS / "table.xml").read_text())
    backend = make_backend(Config(backend=name, world=str(world)), load_robot("icub"))
    before = backend.world.objects["ball"].position
    backend.place("ball", (-0.3, 0.3, 0.5))
    world.write_text("<broken")
    backend.reset(0)
    np.testing.assert_array_equal(backend.world.objects["ball"].position, before)
