# SPDX-License-Identifier: Apache-2.0
"""Calibration by looking at the own hand: derivatives, recovery of drawn errors, gauge freedoms, the file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from mobee import InvalidValue
from mobee.robot.load import load_robot
from mobee.vision.calibration.calibration import Calibration, load_calibration
from mobee.vision.calibration.solve import calibrate
from mobee.vision.encoders import Moment
from mobee.vision.imperfections import CameraErrors, CameraSettings, camera_errors
from mobee.vision.rig import see_points, see_tag
from mobee.vision.stereo import Sighted, locate
from tests.mobee.vision.calibration.synthetic import ENCODERS, MODEL, RIG, ROBOT, SETTINGS, observations, postures

TRUE = RIG.parameters(camera_errors(SETTINGS, ROBOT, list(RIG.cameras), seed=3))


@pytest.fixture(scope="module")
def found() -> Calibration:
    return calibrate(RIG, observations(TRUE, seed=5), SETTINGS)


@pytest.mark.parametrize("camera", RIG.cameras)
def test_derivatives_of_the_predicted_pixels_are_their_slopes(camera: str, rng: np.random.Generator) -> None:
    q, dq, step = postures()[:3], rng.normal(0.0, 0.3, (3, len(ROBOT.motors))), 1e-6
    seen = see_tag(RIG, camera, TRUE, q, dq)
    for k in range(len(TRUE)):
        aside = step * (np.arange(len(TRUE)) == k)
        slope = (see_tag(RIG, camera, TRUE + aside, q, dq).pixels - see_tag(RIG, camera, TRUE - aside, q, dq).pixels) / (2.0 * step)
        np.testing.assert_allclose(seen.by_parameters[..., k], slope, atol=1e-4, rtol=1e-6)
    motors = step * rng.standard_normal(len(ROBOT.motors))
    slope = (see_tag(RIG, camera, TRUE, q + motors, dq).pixels - see_tag(RIG, camera, TRUE, q - motors, dq).pixels) / 2.0
    np.testing.assert_allclose(seen.by_posture @ motors, slope, atol=1e-8)
    points = np.array([-0.35, 0.02, 0.05]) + rng.normal(0.0, 0.02, (3, 1, 3))
    aside = step * rng.standard_normal(3)
    slope = (
        see_points(RIG, camera, TRUE, q, dq, points + aside).pixels - see_points(RIG, camera, TRUE, q, dq, points - aside).pixels
    ) / 2.0
    np.testing.assert_allclose(see_points(RIG, camera, TRUE, q, dq, points).by_point @ aside, slope, atol=1e-8)


def test_drawn_errors_are_found_within_the_reported_covariance(found: Calibration) -> None:
    error = found.x - TRUE
    assert error @ np.linalg.solve(found.covariance, error) < chi2.ppf(0.999, len(error))
    assert found.misfit == pytest.approx(1.0, abs=0.15)
    known = [k for k, name in enumerate(RIG.names) if not any(word in name for word in ("turn_y", "eyes_ver"))]
    assert (found.deviations[known] < 0.1 * found.prior[known]).all()
    assert found.uncalibrated.metres_median > 0.01 > 0.003 > found.calibrated.metres_median


def test_version_and_vergence_cannot_be_told_from_the_cameras_turning_about_the_same_axis(found: Calibration) -> None:
    """A gauge: both are rotations about one axis of the eye, so that the pictures say nothing about their difference."""
    assert len(found.unobservable) == 2
    for one in found.unobservable:
        assert one.information < 1e-6
        assert set(one.weights) <= {"left.turn_y", "right.turn_y", "encoder.eyes_version", "encoder.eyes_vergence"}


def test_places_do_not_depend_on_what_cannot_be_told(found: Calibration, rng: np.random.Generator) -> None:
    """And the covariance of a place is honest: the normalised errors follow the chi-squared distribution."""
    normalised = []
    for q in postures():
        at = MODEL.evaluate(q).position("left_palm") + rng.normal(0.0, 0.03, 3)
        pixels = {name: see_points(RIG, name, TRUE, q[None], 0.0 * q[None], at[None, None]).pixels[0, 0] for name in RIG.cameras}
        sighted = {name: Sighted(pixel + rng.normal(0.0, 0.3, 2), 0.3) for name, pixel in pixels.items()}
        moment = Moment(q + rng.normal(0.0, ENCODERS, len(q)), 0.0 * q, np.full(len(q), ENCODERS**2))
        place = locate(RIG, found.x, moment, sighted, found.covariance)
        assert place is not None
        error = place.position - at
        normalised.append(error @ np.linalg.solve(place.covariance, error))
        assert np.linalg.norm(error) < 0.03
    assert np.mean(np.array(normalised) < chi2.ppf(0.95, 3)) > 0.8
    assert np.median(normalised) == pytest.approx(chi2.ppf(0.5, 3), rel=0.5)


def test_a_false_detection_does_not_spoil_the_result(found: Calibration) -> None:
    seen = observations(TRUE, seed=5)
    for number in (4, 40, 80):
        seen[number] = replace(seen[number], corners={name: corners + [60.0, -35.0] for name, corners in seen[number].corners.items()})
    spoilt = calibrate(RIG, seen, SETTINGS)
    change = np.abs(spoilt.x - found.x) / found.deviations
    assert np.median(change) < 1.0 and change.max() < 5.0


def test_the_file_holds_the_whole_result(found: Calibration, tmp_path: Path) -> None:
    read = load_calibration(found.save(tmp_path / "eyes.json"))
    np.testing.assert_array_equal(read.x, found.x)
    np.testing.assert_array_equal(read.covariance, found.covariance)
    assert (read.names, read.lens, read.tag, read.unobservable) == (found.names, found.lens, found.tag, found.unobservable)
    assert read.rig(ROBOT, RIG.cameras).names == RIG.names
    with pytest.raises(InvalidValue, match="mobee calibrate"):
        read.rig(load_robot("katana"), {})
    (tmp_path / "eyes.json").write_text("{}")
    with pytest.raises(InvalidValue, match="format"):
        load_calibration(tmp_path / "eyes.json")


def test_a_tolerance_of_0_means_no_error() -> None:
    """Without offsets of encoders, everything else is observable."""
    x = TRUE.copy()
    x[RIG.where("encoder")] = 0.0
    exact = calibrate(RIG, observations(x, seed=5), replace(SETTINGS, encoder_offset=0.0))
    assert not exact.x[RIG.where("encoder")].any() and not exact.deviations[RIG.where("encoder")].any()
    unknown = np.flatnonzero(exact.prior)
    error = (exact.x - x)[unknown]
    assert error @ np.linalg.solve(exact.covariance[np.ix_(unknown, unknown)], error) < chi2.ppf(0.999, len(error))
    assert exact.misfit == pytest.approx(1.0, abs=0.15) and exact.unobservable == ()


def test_too_few_pictures_of_the_tag_are_refused() -> None:
    seen = observations(TRUE, seed=5)
    for few in (seen[:5], seen[:5] + [replace(one, corners={}) for one in seen[5:]]):
        with pytest.raises(InvalidValue, match="5 pictures show the tag: at least 8"):
            calibrate(RIG, few, SETTINGS)
    with pytest.raises(InvalidValue, match="corner_noise -1"):
        calibrate(RIG, seen, SETTINGS, corner_noise=-1.0)


@pytest.mark.parametrize("change", ["prior", "variance", "symmetry"])
def test_a_damaged_file_is_refused(found: Calibration, tmp_path: Path, change: str) -> None:
    path = found.save(tmp_path / "eyes.json")
    plain = json.loads(path.read_text())
    if change == "prior":
        plain["parameters"]["latency"]["prior"] = float("nan")
    else:
        plain["covariance"][0][0 if change == "variance" else 1] = -1.0
    path.write_text(json.dumps(plain))
    with pytest.raises(InvalidValue, match="damaged calibration"):
        load_calibration(path)


def test_errors_are_drawn_within_the_tolerances_and_by_the_seed() -> None:
    cameras = list(RIG.cameras)
    drawn = [RIG.parameters(camera_errors(SETTINGS, ROBOT, cameras, seed)) for seed in range(200)]
    for camera in cameras:
        mounts = np.array([x[RIG.where(camera)] for x in drawn])
        assert np.linalg.norm(mounts[:, :3], axis=1).max() <= SETTINGS.mount_position
        assert np.rad2deg(np.linalg.norm(mounts[:, 3:], axis=1)).max() <= SETTINGS.mount_rotation
    np.testing.assert_allclose(np.std(drawn, axis=0), RIG.deviations(SETTINGS.deviations), rtol=0.25)
    np.testing.assert_array_equal(RIG.parameters(RIG.errors(TRUE)), TRUE)
    assert not RIG.parameters(CameraErrors.none(ROBOT, cameras)).any()
    with pytest.raises(InvalidValue):
        CameraSettings(exposure=-1.0)
