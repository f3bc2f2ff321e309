from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.agent import CuriousAgent
from mobee.learning.parallel import run
from mobee.store import TransitionStore
from tests.mobee.learning.toys import InstantPlant, ToyConcurrent, arm, torso, toy_robot


def agents(plant, store=lambda part: None):
    spaces = {"torso": torso(), "left_arm": arm(), "right_arm": arm(side="r")}
    return [CuriousAgent(space, plant, store=store(part)) for part, space in spaces.items()]


def test_each_agent_acts_again_when_its_own_part_has_settled():
    plant = ToyConcurrent(toy_robot(), {"torso": 5.0, "left_arm": 2.0, "right_arm": 3.0})
    run(agents(plant), transitions=30)
    by_part = {part: [t for t, p in plant.log if p == part] for part in ("torso", "left_arm", "right_arm")}
    for part, times in by_part.items():
        assert np.diff(times) == pytest.approx(plant.durations[part])
    assert len(by_part["left_arm"]) > len(by_part["right_arm"]) > len(by_part["torso"])


@pytest.mark.parametrize("total", [1, 2, 7, 30])
def test_transitions_are_counted_over_all_agents_and_none_is_left_under_way(total):
    plant = ToyConcurrent(toy_robot(), {"torso": 2.0, "left_arm": 2.0, "right_arm": 2.0})  # all end at once
    three = agents(plant)
    run(three, total)
    assert sum(agent.transitions for agent in three) == len(plant.log) == total
    with pytest.raises(IndexError):  # nothing left to wait for
        plant.advance()
    run(three, 5)
    assert sum(agent.transitions for agent in three) == total + 5


def test_agents_share_one_file(tmp_path):
    plant = ToyConcurrent(toy_robot(), {"torso": 5.0, "left_arm": 2.0, "right_arm": 3.0})
    path = tmp_path / "run.sqlite"
    three = agents(plant, lambda part: TransitionStore(path, part))
    run(three, 40)
    with TransitionStore(path, "monitor") as store:
        assert {part: len(store.load(part)) for part in store.agents()} == Counter(part for _, part in plant.log)


def test_agents_in_parallel_do_what_they_would_do_alone_where_parts_do_not_interact():
    plant = ToyConcurrent(toy_robot(), {"torso": 5.0, "left_arm": 2.0, "right_arm": 3.0})
    together = agents(plant)
    run(together, 60)
    for one, alone in zip(together, agents(InstantPlant(toy_robot())), strict=True):
        alone.run(one.transitions)
        assert alone.model.tries.tolist() == one.model.tries.tolist()


def test_agents_that_cannot_run_together_are_refused():
    robot = toy_robot()
    plant = ToyConcurrent(robot, {})
    with pytest.raises(InvalidValue, match="no agents"):
        run([], 1)
    with pytest.raises(InvalidValue, match="several agents move torso"):
        run([CuriousAgent(torso(), plant), CuriousAgent(torso(), plant)], 1)
    with pytest.raises(InvalidValue, match="different plants"):
        run([CuriousAgent(torso(), plant), CuriousAgent(arm(), ToyConcurrent(robot, {}))], 1)
    with pytest.raises(InvalidValue, match="InstantPlant has no begin and advance"):
        run([CuriousAgent(torso(), InstantPlant(robot))], 1)
