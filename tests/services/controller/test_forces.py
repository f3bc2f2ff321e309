# SPDX-License-Identifier: Apache-2.0
"""Forces from outside in a live controller act at the contacts that the model publishes; the controller publishes the forces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bus_schema.messages import ContactItem, Forces
from mobee import InvalidValue, Model, Term, load_world
from mobee.arrays import Array
from mobee.control import State
from services.controller.forces import PublishedContacts, load_terms
from tests.services.controller.stage import ROBOT, Stage, staged
from tests.services.harness import rig, wait_for

HERE = "tests.services.controller.test_forces"
LINK = ROBOT.marker("left_palm").link
TOUCH = {"kind": "field", "depth": 0.01, "normal": [0.0, 0.0, 1.0], "point": [-0.3, -0.15, 0.03]}
TOUCHES = [ContactItem(first="palm", second="table", first_link=LINK, second_link=-1, **TOUCH)]


def lift(state: State) -> Array:
    """A force away from contacts, and against the motion."""
    return 100.0 * state.pose.projection - state.velocity


def broken(state: State) -> Array:
    return np.full(len(state.q), np.nan if state.pose.contacts else 0.0)


NAMED = Term("rise", lift)


def test_terms_are_imported_by_name() -> None:
    function, whole = load_terms([f"{HERE}:lift", f"{HERE}:NAMED"])
    assert (function.name, whole.name) == ("lift", "rise")
    for wrong, said in (
        ("nowhere:lift", "No module named 'nowhere'"),
        (f"{HERE}:lost", "has no attribute 'lost'"),
        ("lift", "module:name"),
    ):
        with pytest.raises(InvalidValue, match=f"term {wrong!r}: .*{said}"):
            load_terms([wrong])
    with pytest.raises(InvalidValue, match="the name is taken"):
        load_terms([f"{HERE}:lift", f"{HERE}:lift"])


@pytest.mark.parametrize("least_lever", [0.0, 0.03])
def test_published_contacts_push_as_those_of_a_model_with_the_world(least_lever: float, rng: np.random.Generator) -> None:
    robot = replace(ROBOT, least_lever=least_lever)
    model, blind = Model(robot, load_world("table")), Model(robot)
    for q in rng.uniform(*ROBOT.limits.T, (20, len(ROBOT.motors))):
        seen, published = model.evaluate(q), blind.evaluate(q)
        published.compute_contacts(PublishedContacts(published, [item(contact) for contact in seen.contacts]))
        assert [item(contact) for contact in published.contacts] == [item(contact) for contact in seen.contacts]
        np.testing.assert_allclose(published.projection, seen.projection, atol=1e-12)


def item(c: object) -> ContactItem:
    fields = {name: getattr(c, name) for name in ("first", "second", "kind", "depth", "first_link", "second_link")}
    return ContactItem(**fields, point=list(c.point), normal=list(c.normal))  # type: ignore[attr-defined]  # a Contact


@pytest.fixture
def lifted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    with rig(tmp_path_factory.mktemp("terms"), ROBOT) as made:
        stage = staged(made, "--terms", f"{HERE}:lift")
        stage.sim.frozen = True
        yield stage


def test_a_live_controller_adds_and_publishes_user_defined_terms(lifted: Stage) -> None:
    published: list[Forces] = lifted.rig.record(Forces, "controller")
    lifted.model.contacts = TOUCHES
    lifted.under_control()
    velocity = np.concatenate([lifted.motion(part).dq for part in ROBOT.parts])
    k = lifted.tick()
    pose = Model(ROBOT).evaluate(lifted.sim.q)
    pose.compute_contacts(PublishedContacts(pose, TOUCHES))
    expected = lift(State(ROBOT, lifted.sim.q, velocity, 0.01, lambda: pose))
    said = wait_for(lambda: [one for one in published if one.re_k == k], "the forces")[-1]
    assert list(said.terms) == ["lift"]
    np.testing.assert_allclose(said.terms["lift"], expected, atol=1e-12)
    assert np.abs(expected).max() > 0.1
    moved = np.concatenate([lifted.motion(part).ddq for part in ROBOT.parts])
    np.testing.assert_allclose(moved[expected > 0.1], (expected - 50.0 * velocity)[expected > 0.1], atol=1e-9)  # damping; at its goal


def test_forces_without_contacts_are_refused_by_a_controller_that_needs_them(lifted: Stage) -> None:
    lifted.under_control()
    lifted.model.contacts = None
    for _ in range(6):
        lifted.tick()
    assert lifted.statuses() == {"held"}
    assert lifted.rig.stat("controller").rejected["value"] > 0


def test_a_term_that_fails_ends_the_controller_with_its_name(tmp_path_factory: pytest.TempPathFactory) -> None:
    with rig(tmp_path_factory.mktemp("broken"), ROBOT) as made:
        stage = staged(made, "--terms", f"{HERE}:broken")
        stage.under_control()
        stage.model.contacts = TOUCHES
        stage.sim.tick()
        assert stage.controller.wait(20.0) == 2
        assert "term 'broken': number 0 is nan" in stage.controller.says
        assert "Traceback" not in stage.controller.says


def test_a_missing_term_is_refused_in_one_line(tmp_path_factory: pytest.TempPathFactory) -> None:
    with rig(tmp_path_factory.mktemp("missing"), ROBOT) as made:
        program = made.spawn("-m", "services.controller", "--endpoint", made.endpoint, "--terms", "nowhere:lift")
        assert program.wait(20.0) == 2
        assert "term 'nowhere:lift'" in program.says and "Traceback" not in program.says
