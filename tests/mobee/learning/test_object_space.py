# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from mobee import CuriousAgent, Grid, ObjectSpace, PerceivingPlant, Planner
from mobee.arrays import Array
from mobee.errors import InvalidValue, MobeeError
from mobee.learning.discrete import DiscreteSpace
from mobee.learning.explorers import EXPLORERS
from mobee.learning.lattice import Lattice, plane_layout
from mobee.learning.record import load_learned, space_from
from mobee.learning.space import Space, pruned, with_shortcuts
from mobee.plant import Outcome
from mobee.store import TransitionStore
from tests.mobee.learning.toys import InstantPlant, toy_robot

LINE = Grid((0.0, 0.4), (0.0, 0.1), (4, 1))
PUSH = (1, 2)  # from the middle of the elbow to its upper end: the object moves by a cell


class Pusher(InstantPlant):
    """An elbow of three postures; each time it goes from the middle up, the object moves by one cell, from the last to the first."""

    def __init__(self) -> None:
        super().__init__(toy_robot())
        self.cell, self.hidden = 0, False

    def act(self, part: str, target: Array) -> Outcome:
        before = self.q[part][3]
        outcome = super().act(part, target)
        low, high = np.deg2rad((15.5, 106))
        if abs(before - (low + high) / 2) < 0.1 and target[3] > before + 0.1:
            self.cell = (self.cell + 1) % len(LINE)
        return outcome

    def perceive(self) -> Mapping[str, Array]:
        return {} if self.hidden else {"cup": np.append(LINE.centre(self.cell), 0.0)}


def space() -> ObjectSpace:
    return ObjectSpace(Lattice(toy_robot(), ["l_elbow"], neighbours="equidistant"), LINE, "cup")


def agent(plant: Pusher, explorer: str = "curious", **options) -> CuriousAgent:
    return CuriousAgent(space(), PerceivingPlant(plant, plant.perceive), explorer, **options)


def test_a_state_is_a_posture_and_a_cell_and_actions_are_expected_to_leave_the_object_where_it_is() -> None:
    made = space()
    assert (len(made), made.state_actions) == (12, 16)
    assert [(made.posture(s), made.cell(s)) for s in (0, 2, 3, 11)] == [(0, 0), (2, 0), (0, 1), (2, 3)]
    assert made.actions(made.state(1, 2)).tolist() == [6, 8]
    assert made.in_cell(2).tolist() == [6, 7, 8]
    assert made.target(7).tolist() == made.postures.target(1).tolist()
    outcome = Outcome(made.postures.target(1), True, 1.0, perceived={"cup": np.append(LINE.centre(3), 0.0)})
    assert made.state_after(outcome) == made.state(1, 3)


def test_an_object_that_is_not_perceived_is_believed_where_it_was() -> None:
    made = space()
    hidden = Outcome(made.postures.target(2), True, 1.0)
    assert made.state_after(hidden, before=made.state(0, 3)) == made.state(2, 3)
    with pytest.raises(MobeeError, match="place of cup is not known"):
        made.state_after(hidden)


def test_a_perceiving_function_that_returns_no_dict_is_refused() -> None:
    plant = PerceivingPlant(Pusher(), lambda: None)
    with pytest.raises(InvalidValue, match="returned None.* {} if none is perceived"):
        plant.act("left_arm", plant.measure("left_arm"))
    with pytest.raises(InvalidValue, match="returned None"):
        CuriousAgent(space(), plant).step()


def test_a_posture_alone_is_no_state() -> None:
    with pytest.raises(InvalidValue, match="state_after"):
        space().state_of(np.zeros(5))
    with pytest.raises(InvalidValue, match=r"posture \+ 3 x cell"):
        space().state_of_joints(np.zeros(1))


@pytest.mark.parametrize("explorer", list(EXPLORERS))
def test_every_explorer_works_unchanged(explorer: str) -> None:
    found = agent(Pusher(), explorer)
    found.run(40)
    assert found.model.tries.sum() == 40


def test_it_learns_which_action_moves_the_object_and_plans_to_move_it_to_a_cell() -> None:
    plant = Pusher()
    learner = agent(plant)
    learner.run(150)
    made = learner.space
    assert isinstance(made, ObjectSpace)
    beliefs = learner.model.debiased()
    moving = {
        (made.posture(s), made.posture(made.goal(s, a)))
        for s in range(len(made))
        for a in range(len(made.actions(s)))
        if made.cell(int(beliefs.outcomes[s, a, beliefs.probabilities[s, a].argmax()])) != made.cell(s)
    }
    assert moving == {PUSH}
    plan = Planner(made, beliefs, made.in_cell(2)).plan(made.state(0, 0))
    assert made.cell(plan.path[-1]) == 2 and plan.success > 0.9


def test_while_it_is_hidden_the_agent_continues() -> None:
    plant = Pusher()
    learner = agent(plant, "random")
    learner.run(10)
    plant.hidden, cell = True, space().cell(learner.state)
    learner.run(10)
    assert space().cell(learner.state) == cell


def test_the_record_makes_the_space_again_and_the_agent_continues(tmp_path: Path) -> None:
    made = space()
    assert space_from(made.settings, made.robot).settings == made.settings
    file = tmp_path / "transitions.sqlite"
    with TransitionStore(file, made.part) as store:
        agent(Pusher(), store=store).run(60)
    with TransitionStore(file, made.part) as store:
        assert agent(Pusher(), store=store).transitions == 60
    learned = load_learned(file, robot=made.robot)
    assert isinstance(learned.space, ObjectSpace) and learned.model.tries.sum() == 60


def test_it_is_drawn_as_a_block_of_postures_in_each_cell() -> None:
    made = space()
    drawn = plane_layout(made)
    assert len(np.unique(drawn.round(6), axis=0)) == len(made)
    assert np.ptp(drawn[made.in_cell(0)], axis=0).tolist() == np.ptp(drawn[made.in_cell(3)], axis=0).tolist() == [2.0, 0.0]
    assert (np.diff([drawn[made.in_cell(cell), 0].mean() for cell in range(4)]) > 2.0).all()


def test_the_cells_of_two_objects_are_refused() -> None:
    with pytest.raises(InvalidValue, match="of one object only"):
        ObjectSpace(space(), LINE, "ball")


@pytest.mark.parametrize("given", [space(), DiscreteSpace(3, 2)])
def test_a_space_whose_states_are_no_poses_alone_is_not_adapted(given: Space) -> None:
    for adapted in (lambda: pruned(given, []), lambda: with_shortcuts(given, [], 1)):
        with pytest.raises(InvalidValue, match="its states are not poses alone"):
            adapted()


def test_too_many_states_are_refused() -> None:
    with pytest.raises(InvalidValue, match="the limit is"):
        ObjectSpace(space().postures, Grid((0.0, 1.0), (0.0, 1.0), (300, 300), margin=0.0), "cup")
