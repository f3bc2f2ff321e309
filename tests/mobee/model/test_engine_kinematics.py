# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee._core.engine import sines_cosines
from mobee.arrays import Array
from mobee.model.kinematics import link_transforms, point_jacobian
from mobee.model.model import engine_of
from tests.mobee.model.random_scenes import loaded, posed, random_robot

ULP = 2.0**-52


def exact(angles: Array) -> tuple[Array, Array]:
    """Sine and 1 - cosine in extended precision, the second without cancellation."""
    wide = angles.astype(np.longdouble)
    return np.sin(wide), 2 * np.sin(wide / 2) ** 2


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="no extended precision to compare with")
@pytest.mark.parametrize("largest", [1e-150, 1e-8, 1e-3, 0.7, 4.0, 20.0, 1e3, 9e4])
def test_sines_and_cosines_are_right_to_the_last_bits(largest: float, rng: np.random.Generator) -> None:
    angles = rng.uniform(-largest, largest, 20_000)
    (sines, versines), (sine, versine) = sines_cosines(angles), exact(angles)
    # Up to an eighth of a turn relative to the value, beyond it relative to 1, from which the other branches start.
    assert (abs(sines - sine) <= 1.5 * ULP * np.where(largest < 0.75, abs(sine), 1.0)).all()
    assert (abs(versines - versine) <= 2.0 * ULP * np.where(largest < 0.75, versine, 1.0)).all()


@pytest.mark.parametrize("angle", [0.0, -0.0, np.pi / 4, -np.pi / 4, np.pi / 2, np.pi, 3 * np.pi / 2, 2 * np.pi, -7 * np.pi / 2])
def test_borders_of_the_reduction_are_no_exception(angle: float) -> None:
    angles = np.array([np.nextafter(angle, -9.0), angle, np.nextafter(angle, 9.0)])
    sines, versines = sines_cosines(angles)
    assert sines == pytest.approx(np.sin(angles), abs=ULP)
    assert versines == pytest.approx(1.0 - np.cos(angles), abs=2 * ULP)


@pytest.mark.parametrize("huge", [1e5, 1e9, 1e15, 1e300])
def test_huge_angles_are_those_of_numpy(huge: float, rng: np.random.Generator) -> None:
    angles = rng.uniform(-huge, huge, 1000)
    sines, versines = sines_cosines(angles)
    assert sines == pytest.approx(np.sin(angles), abs=2 * ULP)
    assert versines == pytest.approx(1.0 - np.cos(angles), abs=2 * ULP)


@given(st.integers(0, 2**32), st.integers(0, 12))
def test_links_are_where_the_readable_definition_puts_them(seed: int, joints: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints, 0)
    q = posed(rng, robot, 4)
    assert engine_of(robot).transforms(q) == pytest.approx(link_transforms(robot, q), abs=1e-14)


@pytest.mark.parametrize("name", ["icub", "icub_2014", "katana"])
def test_links_of_shipped_robots_are_where_the_readable_definition_puts_them(name: str, rng: np.random.Generator) -> None:
    robot = loaded(name)
    q = posed(rng, robot, 50)
    assert engine_of(robot).transforms(q) == pytest.approx(link_transforms(robot, q), abs=2e-15)


@given(st.integers(0, 2**32), st.integers(0, 12))
def test_jacobians_are_those_of_the_readable_definition(seed: int, joints: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints, 0)
    q, link, point = posed(rng, robot, 3), int(rng.integers(joints + 1)), rng.uniform(-1, 1, 3)
    transforms = link_transforms(robot, q)
    now = transforms[:, link, :3, :3] @ point + transforms[:, link, :3, 3]
    assert engine_of(robot).jacobians(q, link, point) == pytest.approx(point_jacobian(robot, transforms, link, now), abs=1e-13)
