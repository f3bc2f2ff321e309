# SPDX-License-Identifier: Apache-2.0
"""Forces from outside, beside those of the law."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.control import Controller, Forces, State, Term, constraint_forces
from mobee.control.forces import published_terms
from mobee.control.gains import Gains
from mobee.errors import InvalidValue
from mobee.simulation import OfflinePlant
from tests.mobee.control.two_parts import STRETCHED, touching

DT = 0.01
GOAL = np.array([-0.5, 0.1, 0.0])


def pull(state: State) -> Array:
    """Depends on all there is."""
    depth = sum(contact.depth for contact in state.pose.contacts)
    return depth * (1.0 - state.velocity) * len(state.robot.motors) * state.dt + 0.1 * state.q


def steady(state: State) -> Array:
    return np.array([0.3, -0.2, 0.1])


TERMS = (Term("pull", pull), Term("steady", steady))


def test_the_law_has_the_terms_of_the_core_and_then_those_that_are_given() -> None:
    controller = Controller(touching(), terms=TERMS)
    assert controller.force_names == (*published_terms(), "pull", "steady") == tuple(controller.last_forces)
    alone, model = Controller(touching()), touching()
    controller.attractor = alone.attractor = GOAL
    controller.step(STRETCHED, DT)
    forces = alone.forces(model.evaluate(STRETCHED))
    more = {
        term.name: np.array(term.function(State(model.robot, STRETCHED, np.zeros(3), DT, lambda: model.evaluate(STRETCHED))))
        for term in TERMS
    }
    alone.step(STRETCHED, DT, Forces(**forces, **more))
    assert np.array_equal(controller.acceleration, alone.acceleration)
    assert {name: force.tolist() for name, force in controller.last_forces.items()} == {
        name: force.tolist() for name, force in alone.last_forces.items()
    }
    assert np.array_equal(
        controller.last_forces.total, forces.limits + forces.constraints + forces.collision + more["pull"] + more["steady"]
    )


@pytest.mark.parametrize("modality", ["velocity", "torque"])
@pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
def test_the_offline_plant_and_the_controller_agree(gains: Gains, modality: str) -> None:
    plant, alone = OfflinePlant(touching(), 3, gains, modality=modality, terms=TERMS), Controller(touching(), gains, modality, terms=TERMS)
    plant.controller.attractor = alone.attractor = GOAL
    for controller in (plant.controller, alone):
        controller.force(np.array([0.0, 2.0, 0.0]))
    trace = plant.run(60)
    assert trace.field.max() > 0.0
    assert np.array_equal([alone.step(q, DT).velocity for q in trace.encoders], trace.velocity)
    assert all(np.array_equal(alone.last_forces[name], force) for name, force in plant.controller.last_forces.items())
    assert plant.settings["terms"] == ["pull", "steady"]
    assert "terms" not in OfflinePlant(touching()).settings


def test_motors_that_do_not_live_are_left_alone() -> None:
    plant = OfflinePlant(touching(), active=["arm"], terms=TERMS)
    plant.run(20)
    steady = plant.controller.last_forces["steady"]
    assert steady.tolist() == [0.0, -0.2, 0.1]
    assert plant.controller.velocity[0] == 0.0


def test_forces_that_are_given_are_filled_up_at_the_pose_that_is_given() -> None:
    controller, seen = Controller(touching(), terms=TERMS), touching(-0.04)
    pose = seen.evaluate(STRETCHED)
    forces = controller.forces(pose)
    controller.step(STRETCHED, DT, forces, pose)
    depth = sum(contact.depth for contact in pose.contacts)
    assert controller.last_forces["pull"] == pytest.approx([depth * 3 * DT] * 3)
    assert controller.last_forces.collision is forces.collision
    given = Forces(**forces, pull=np.ones(3))
    controller.step(STRETCHED, DT, given)
    assert controller.last_forces["pull"].tolist() == [1.0] * 3


def test_a_pose_that_no_term_asks_for_is_not_evaluated() -> None:
    class Counting:
        asked = 0

        def __init__(self) -> None:
            self.model = touching()
            self.robot = self.model.robot

        def track(self) -> Counting:
            return self

        def evaluate(self, q: Array) -> object:
            self.asked += 1
            return self.model.evaluate(q)

    model = Counting()
    controller = Controller(model, terms=[TERMS[1]])  # type: ignore[arg-type]  # a user-defined model
    free = Forces(np.zeros(3), np.zeros(3), np.zeros(3))
    controller.step(STRETCHED, DT, free)
    assert model.asked == 0
    Controller(model, terms=TERMS).step(STRETCHED, DT)  # type: ignore[arg-type]  # the same
    assert model.asked == 1


def overwriting(state: State) -> Array:
    state.q[:] = 0.0
    return state.q


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda state: np.zeros(2), r"of shape \(2,\): must be 3 finite numbers"),
        (lambda state: np.array([0.0, np.nan, 0.0]), "number 1 is nan"),
        (lambda state: [2e9] * 3, "must be at most 1e"),
        (lambda state: "much", "must be an array of numbers"),
        (lambda state: None, "must be"),
        (lambda state: state.speed, "its function raised AttributeError: .*speed"),
        (overwriting, "raised ValueError: .*read-only"),
    ],
)
def test_a_term_that_gives_no_force_is_refused_by_its_name(function: Callable[[State], Array], said: str) -> None:
    terms = (Term("wild", function),)
    for act in (lambda: Controller(touching(), terms=terms).step(STRETCHED, DT), lambda: OfflinePlant(touching(), terms=terms).tick()):
        with pytest.raises(InvalidValue, match=f"term 'wild'.*{said}"):
            act()


def test_names_are_ones_own() -> None:
    for name in ("limits", "collision", "total", "items"):
        with pytest.raises(InvalidValue, match=f"term {name!r}: the name is taken; taken are collision, constraints, limits"):
            OfflinePlant(touching(), terms=[Term(name, steady)])
    with pytest.raises(InvalidValue, match="'pull'"):
        Controller(touching(), terms=[TERMS[0], TERMS[0]])
    with pytest.raises(InvalidValue, match="each must be a Term"):
        Controller(touching(), terms=[steady])  # type: ignore[list-item]  # a wrong type
    for wrong in ("", "Push", "a b", "_own", "x" * 65, 3):
        with pytest.raises(InvalidValue, match="name of a term"):
            Term(wrong, steady)  # type: ignore[arg-type]  # 3 is of a wrong type
    with pytest.raises(InvalidValue, match="must be a function"):
        Term("push", 3.0)  # type: ignore[arg-type]  # a wrong type


def test_forces_are_a_mapping_and_their_names_are_attributes() -> None:
    forces = constraint_forces(touching().evaluate(STRETCHED), Gains.default())
    assert list(forces) == list(published_terms()) == ["limits", "constraints", "collision"]
    assert forces["collision"] is forces.collision and forces.collision.any()
    again = pickle.loads(pickle.dumps(copy.deepcopy(forces)))
    assert {name: force.tolist() for name, force in again.items()} == {name: force.tolist() for name, force in forces.items()}
    assert forces == forces and forces != again and len({forces, again}) == 2
    with pytest.raises(AttributeError, match="there is no force 'colission'"):
        _ = forces.colission
    with pytest.raises(InvalidValue, match="constraints, collision missing; give all of limits, constraints, collision"):
        Forces(np.zeros(3))
    with pytest.raises(InvalidValue, match="the law has limits, constraints, collision"):
        Forces(*np.zeros((4, 3)))
    with pytest.raises(InvalidValue, match="3 without a name, limits by name"):
        Forces(*np.zeros((3, 3)), limits=np.zeros(3))
