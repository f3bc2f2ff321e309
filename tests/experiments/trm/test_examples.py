from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.trm.examples import EXAMPLES
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.term import Term


def at(task: Task, y: tuple[float, ...], spacing: float) -> list[Term]:
    """The task coordinates as terms."""
    return [
        Term(
            one.name,
            lambda pose, one=one, value=value: np.abs(one.function(pose) - value),
            1.0 / spacing,
            0.1 * spacing,
            lambda robot, one=one, value=value: one.aims(robot, value),
        )
        for one, value in zip(task.coordinates, y, strict=True)
    ]


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_pose_of_every_example_is_found_at_once_where_its_film_begins(name: str) -> None:
    example = EXAMPLES[name]()
    y = example.way[0]
    terms = [*example.costs, *at(example.task, y, float(np.min(example.spacing)))]
    ik = mobee.solve_ik(example.model, terms, start=example.start, motors=example.motors, method="least_squares")
    assert ik.reached and not ik.contacts
    assert np.abs(example.task.of(example.model.evaluate(ik.q[None]))[0] - y).max() <= 0.1 * np.max(example.spacing)


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_the_pictures_of_an_example_ask_for_is_there(name: str) -> None:
    example = EXAMPLES[name]()
    low, high = example.task.box.T
    assert all(len(y) == len(low) and (low <= y).all() and (y <= high).all() for y in example.way)
    assert set(example.markers) <= set(example.model.robot.markers)
    assert all(thing.role != "ghost" or thing.link is not None for thing in example.model.world.objects.values())
