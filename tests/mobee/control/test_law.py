from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.control import Controller, Gains
from mobee.control.law import Law
from mobee.model import Model
from mobee.robot.load import load_robot
from tests.mobee.control import oracle

SETS = [
    Gains.default(),
    Gains.published_2014(),
    Gains.default().with_motors("*_elbow", stiffness=50.0, damping=30.0, max_limit=60.0, limit_width=0.1, max_spring=9.0),
]
EACH = pytest.mark.parametrize("gains", SETS, ids=["default", "published_2014", "per motor"])
ICUB = load_robot("icub")


@EACH
@given(seed=st.integers(0, 10_000))
def test_the_forces_are_those_of_the_formulas(gains: Gains, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = rng.uniform(ICUB.limits[:, 0] - 0.2, ICUB.limits[:, 1] + 0.2)
    torque = rng.normal(size=len(q)) * 10.0 ** rng.uniform(-6, 1) * (rng.random(len(q)) < 0.5)
    expected, found = oracle.forces(ICUB, gains, q, torque), oracle.compiled_forces(ICUB, gains, q, torque)
    assert found.limits == pytest.approx(expected.limits, rel=1e-12, abs=1e-12)
    assert found.constraints == pytest.approx(expected.constraints, rel=1e-11, abs=1e-11)
    assert found.collision == pytest.approx(expected.collision, rel=1e-12, abs=1e-12)


@EACH
@pytest.mark.parametrize("dt", [0.002, 0.02])
def test_the_motion_is_that_of_the_formulas(gains: Gains, dt: float) -> None:
    rng = np.random.default_rng(3)
    controller = Controller(Model(ICUB), gains, speed_scale=0.5)
    q = rng.uniform(*ICUB.limits.T)
    controller.reset(q)
    slow = oracle.Law(ICUB, gains, 0.5, q)
    for _ in range(50):
        controller.attractor = goal = rng.uniform(*ICUB.limits.T)
        forces = controller.forces(controller.model.evaluate(q))
        command = controller.step(q, dt, forces)
        slow.step(q, dt, goal, forces.total)
        assert command.velocity == pytest.approx(slow.velocity, rel=1e-12, abs=1e-12)
        assert command.position == pytest.approx(slow.reference, rel=1e-12, abs=1e-12)
        assert controller.acceleration == pytest.approx(slow.acceleration, rel=1e-11, abs=1e-11)
        q = q + command.velocity * dt + rng.normal(size=len(q)) * 1e-3


def test_only_motors_that_live_and_have_weight_are_moved_and_only_those_that_live_feel() -> None:
    arm = ICUB.part("left_arm")
    alive = np.zeros(len(ICUB.motors), dtype=bool)
    alive[arm.slice] = True
    law = Law(ICUB, Gains.published_2014(), alive=alive)
    assert (len(law.active), len(law.felt)) == (7, 16)
    beyond = ICUB.limits[:, 1] + 0.1
    limits, constraints, collision = law.forces(beyond, np.ones(len(beyond)))
    assert np.all(limits[alive] < 0) and not limits[~alive].any()
    assert constraints[alive].any()
    assert np.all(collision[alive] > 0) and not collision[~alive].any()
    state = law.at_rest(beyond)
    law.step(beyond, 0.01, ICUB.home, limits, state)
    assert np.flatnonzero(state["velocity"]).tolist() == list(range(arm.start, arm.start + 7))


def test_the_reference_of_a_motor_that_is_never_moved_is_within_its_limits() -> None:
    law = Law(ICUB, replace(Gains.default(), weights=(("*", 0.0),)))
    state = law.at_rest(ICUB.limits[:, 1] + 0.1)
    assert state["reference"] == pytest.approx(ICUB.limits[:, 1])


def test_all_that_the_default_law_pulls_with_together_is_weaker_than_a_limit() -> None:
    gains = Gains.default()
    spring, client, limit = (gains.of_motors(name, ICUB.motors) for name in ("max_spring", "max_client", "max_limit"))
    assert (spring + 2.0 * client < limit).all()  # f_config and f_work are bounded each by itself
