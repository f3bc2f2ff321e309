from __future__ import annotations

import csv

import numpy as np
import pytest

import mobee
from experiments.identify.figure import draw
from experiments.identify.fitting import Fit
from experiments.identify.report import csv_table, summary, toml_data
from mobee.simulation import MotorParameters, identified

ROBOT = mobee.load_robot("icub")
COUNT = len(ROBOT.motors)


@pytest.fixture
def fit(rng) -> Fit:
    values = {name: tuple(rng.uniform(0.01, 0.1, COUNT)) for name in ("lag", "delay", "backlash", "friction")}
    ones = np.ones(COUNT)
    deviation = dict.fromkeys(values, 0.01 * ones)
    return Fit(MotorParameters(**values), deviation, np.deg2rad(0.1) * ones, ones, 0.0 * ones, ones, 0.0 * ones)


def test_the_data_that_is_written_is_read_back(fit, tmp_path, monkeypatch):
    (tmp_path / "icub.toml").write_text(toml_data(ROBOT, fit, seed=0))
    monkeypatch.setattr(identified, "FOLDER", tmp_path)
    found = MotorParameters.identified("icub")
    for name in ("lag", "delay", "backlash", "friction"):
        assert getattr(found, name) == pytest.approx(getattr(fit.parameters, name), abs=6e-5), name
    assert found.encoder_noise == pytest.approx(np.deg2rad(0.1), abs=1e-6)


def test_the_table_has_a_line_a_motor_in_degrees(fit):
    rows = list(csv.DictReader(csv_table(ROBOT, fit).splitlines()))
    assert [row["motor"] for row in rows] == list(ROBOT.motors)
    assert float(rows[3]["backlash_deg"]) == pytest.approx(np.rad2deg(fit.parameters.backlash[3]), rel=1e-4)
    assert float(rows[3]["noise_deg"]) == pytest.approx(0.1)


def test_the_distance_from_the_published_settings_is_told_in_deviations(fit):
    told = summary(ROBOT, fit)["parameters"]["lag"]
    assert told["farthest_from_published_in_deviations"] == pytest.approx(np.abs(np.array(fit.parameters.lag) - 0.05).max() / 0.01)


def test_a_run_without_a_fit_has_no_figure(tmp_path):
    with pytest.raises(mobee.InvalidValue, match="--resume"):
        draw(ROBOT, [], tmp_path / "motors.csv", tmp_path / "identify.png")
