# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections import Counter
from functools import partial

import numpy as np
import pytest

from mobee.errors import ActionInterrupted, InvalidValue, MobeeError, UnknownName
from mobee.learning.agent import CuriousAgent, run
from mobee.learning.explorers import EXPLORERS
from mobee.learning.lattice import Lattice
from mobee.learning.tabular import TabularPlant, ideal
from mobee.learning.transitions import kl_divergence
from mobee.plant import Outcome
from mobee.store import TransitionStore
from tests.mobee.learning.toys import TORSO, FickleDice, InstantPlant, Interrupting, ToyConcurrent, arm, torso, toy_robot
from tests.services.an_explorer import last_action


def test_a_step_decides_acts_and_observes():
    space = arm(neighbours="equidistant")
    agent = CuriousAgent(space, InstantPlant(space.robot))
    assert agent.state == 40
    reward = agent.step()
    assert reward == pytest.approx(kl_divergence((2, 3), (2, 2)))
    assert agent.transitions == agent.model.tries.sum() == 1
    assert agent.last.s == 40
    assert agent.state == agent.last.s_next == space.goal(40, agent.last.a)


def test_deciding_and_observing_are_two_plain_steps():
    space = torso()
    agent = CuriousAgent(space, InstantPlant(space.robot))
    action = agent.decide(0)
    assert np.array_equal(agent.target(action), space.target(space.goal(0, action)))
    assert agent.observe(Outcome(space.target(0), settled=False, duration=20.0, touched=("table",))) > 0
    assert (agent.last.s, agent.last.s_next, agent.last.settled, agent.last.touched) == (0, 0, False, ("table",))
    with pytest.raises(MobeeError, match=r"call decide\(state\) first"):
        agent.observe(Outcome(space.target(0), True, 1.0))


def test_the_state_is_read_in_the_order_of_the_part():
    robot = toy_robot()
    space = Lattice(robot, list(TORSO)[::-1], neighbours=8)
    agent = CuriousAgent(space, InstantPlant(robot, {"torso": space.target(2)}))
    assert agent.state == 2


def hypercube_transitions(seed, discount):
    """Transitions until every state-action of the hypercube was tried five times (thesis 7.1)."""
    space = arm((0.25, 0.75), "equidistant")
    start = space.target(int(np.random.default_rng(seed).integers(16)))
    agent = CuriousAgent(space, InstantPlant(space.robot, {"left_arm": start}), seed=seed, discount=discount)
    while agent.model.tries.min() < 5 and agent.transitions < 1000:
        agent.step()
    return agent.transitions


@pytest.mark.parametrize("discount", [0.5, 0.9, 0.99])
def test_the_hypercube_takes_the_320_transitions_of_the_thesis(discount):
    taken = [hypercube_transitions(seed, discount) for seed in range(4)]
    assert min(taken) >= 320 and max(taken) <= 326


def test_the_hypercube_s_values_grow_with_the_discount_and_spread_evenly():
    space = arm((0.25, 0.75), "equidistant")
    values = []
    for discount in (0.5, 0.9):
        agent = CuriousAgent(space, InstantPlant(space.robot), discount=discount)
        agent.run(320)
        values.append(agent.plan()[0])
        assert np.ptp(values[-1]) < 0.5 * values[-1].mean()
    assert values[1].mean() > 2 * values[0].mean()


def test_curiosity_covers_the_lattice_in_fewer_transitions_than_its_rivals():
    space = arm(neighbours="equidistant")
    taken = {}
    for explorer in ("curious", "least_tried", "random"):
        agent = CuriousAgent(space, InstantPlant(space.robot), explorer)
        while agent.model.tries[space.goals >= 0].min() == 0 and agent.transitions < 5000:
            agent.step()
        taken[explorer] = agent.transitions
    assert 432 <= taken["curious"] <= 460
    assert taken["curious"] < taken["least_tried"] < taken["random"]


def test_the_same_seed_gives_the_same_run_and_another_seed_another():
    def run(seed):
        agent = CuriousAgent(arm(), FickleDice(toy_robot(), seed=5), seed=seed)
        agent.run(50)
        return [agent.last, agent.model.tries.tolist()]

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_agents_of_different_parts_draw_differently_under_one_seed():
    def actions(side):
        space = arm(side=side)
        agent = CuriousAgent(space, InstantPlant(space.robot))
        chosen = []
        for _ in range(10):
            agent.step()
            chosen.append(agent.last.a)
        return chosen

    assert actions("l") != actions("r")


def test_an_explorer_of_the_user_is_called_and_recorded_by_its_module():
    space = arm()
    agent = CuriousAgent(space, InstantPlant(space.robot), explorer=last_action)
    agent.run(5)
    assert agent.last.a == len(space.actions(agent.last.s)) - 1
    assert agent.settings["explorer"] == f"{last_action.__module__}:last_action"
    named = CuriousAgent(space, InstantPlant(space.robot), explorer=agent.settings["explorer"])
    named.run(5)
    assert named.last == agent.last and named.settings == agent.settings


@pytest.mark.parametrize(
    ("explorer", "said"),
    [
        ("last_actoin", "unknown explorer 'last_actoin'.*module:name of your own"),
        ("no_such_module:last_action", "No module named 'no_such_module'.*working directory"),
        ("tests.services.an_explorer:first", "has no attribute 'first'"),
        ("math:pi", "cannot be called"),
        (lambda agent, state, rng: np.zeros(3), r"give a score for each action, shape \(16,\)"),
        (lambda agent, state, rng: np.full(16, np.nan), "give a score for each action"),
        (lambda agent, state, rng: ["much"] * 16, "returned .'much'.*give a score for each action"),
        (lambda agent, state, rng: np.full(16, 1j), "give a score for each action"),
    ],
    ids=["no name", "no module", "no function", "no function at all", "wrong shape", "not finite", "no numbers", "complex"],
)
def test_an_explorer_that_does_not_serve_is_refused(explorer, said):
    space = arm()
    with pytest.raises(MobeeError, match=said):
        CuriousAgent(space, InstantPlant(space.robot), explorer=explorer).run(1)


class Listed:
    @staticmethod
    def last_action(agent, state, rng):
        return [float(action) for action in range(len(agent.model.space.actions(state)))]


def test_scores_may_be_a_list_and_the_explorer_a_function_of_a_class():
    space = arm()
    agents = [CuriousAgent(space, InstantPlant(space.robot), explorer=one) for one in (last_action, Listed.last_action)]
    agents.append(CuriousAgent(space, InstantPlant(space.robot), explorer=agents[1].settings["explorer"]))
    for agent in agents:
        agent.run(5)
    assert agents[0].last == agents[1].last == agents[2].last


@pytest.mark.parametrize(
    ("explorer", "said"),
    [(lambda agent, state, rng: np.zeros(16), "<lambda>"), (partial(last_action), "functools:partial.*another one than the given")],
)
def test_a_change_to_an_explorer_that_a_restarted_agent_could_not_find_is_refused(tmp_path, explorer, said):
    space = arm()
    with TransitionStore(tmp_path / "run.sqlite", space.part) as store:
        agent = CuriousAgent(space, InstantPlant(space.robot), store=store)
        with pytest.raises(InvalidValue, match=said):
            agent.explore_by(explorer)
        agent.explore_by(last_action)
        agent.run(2)
        again = CuriousAgent(space, InstantPlant(space.robot), store=store)
        assert (again.explorer, again.transitions) == (agent.explorer, 2)


RESUMED = [{"explorer": name} for name in EXPLORERS] + [
    {"beliefs": "debiased"},
    {"divergence": "kl"},
    {"forgetting": 0.9},
    {"tolerance": 1e-3, "relative": False},
    {"goal": [3], "goal_weight": 0.05},
]


@pytest.mark.parametrize("options", RESUMED, ids=str)
def test_a_resumed_agent_does_what_an_uninterrupted_one_does(tmp_path, options):
    def make(name, plant):
        return CuriousAgent(arm(), plant, seed=3, store=TransitionStore(tmp_path / name, "left_arm"), **options)

    whole = make("whole.sqlite", FickleDice(toy_robot(), seed=9))
    whole.run(90)

    first = make("parts.sqlite", FickleDice(toy_robot(), seed=9))
    first.run(37)
    first.store.close()
    first.plant.q["left_arm"] = np.array(first.last.q)
    again = make("parts.sqlite", FickleDice(toy_robot(), seed=9, actions=37, start={"left_arm": np.array(first.last.q)}))
    assert again.transitions == 37 and again.last == first.last
    assert np.array_equal(again.model.reward, first.model.reward)
    again.run(53)

    assert again.store.load() == whole.store.load()
    assert np.array_equal(again.model.probabilities, whole.model.probabilities)
    assert np.array_equal(again.model.tries, whole.model.tries)
    assert np.array_equal(again.plan()[1], whole.plan()[1])


def test_plans_that_only_an_observer_requests_do_not_change_later_decisions(tmp_path):
    def make(name, plant):
        return CuriousAgent(arm(), plant, seed=3, explorer="random", store=TransitionStore(tmp_path / name, "left_arm"))

    def observed(agent, transitions):
        for _ in range(transitions):
            agent.plan()
            agent.step()

    whole = make("whole.sqlite", FickleDice(toy_robot(), seed=9))
    observed(whole, 60)
    whole.explore_by("curious")
    observed(whole, 40)

    first = make("parts.sqlite", FickleDice(toy_robot(), seed=9))
    observed(first, 60)
    first.explore_by("curious")
    first.store.close()
    again = make("parts.sqlite", FickleDice(toy_robot(), seed=9, actions=60, start={"left_arm": np.array(first.last.q)}))
    again.run(40)
    assert np.array_equal(again.plan()[1], whole.plan()[1])
    assert again.store.load() == whole.store.load()


def test_an_agent_whose_explorer_was_changed_goes_on_as_if_it_had_never_stopped(tmp_path):
    def make(name, plant):
        return CuriousAgent(arm(), plant, seed=3, store=TransitionStore(tmp_path / name, "left_arm"))

    whole = make("whole.sqlite", FickleDice(toy_robot(), seed=9))
    whole.run(20)
    whole.explore_by("least_tried")
    whole.run(10)
    whole.explore_by("curious")
    whole.run(20)

    first = make("parts.sqlite", FickleDice(toy_robot(), seed=9))
    first.run(20)
    first.explore_by("least_tried")
    first.run(5)
    first.store.close()
    again = make("parts.sqlite", FickleDice(toy_robot(), seed=9, actions=25, start={"left_arm": np.array(first.last.q)}))
    assert (again.explorer, again.settings["explorer"]) == ("least_tried", "curious")
    again.run(5)
    again.explore_by("curious")
    again.run(20)
    assert again.store.load() == whole.store.load()
    assert np.array_equal(again.plan()[1], whole.plan()[1])
    again.store.close()

    continued = CuriousAgent(
        arm(),
        InstantPlant(toy_robot()),
        seed=3,
        store=TransitionStore(tmp_path / "more.sqlite", "left_arm"),
        continues=tmp_path / "parts.sqlite",
    )
    assert continued.store.explorers() == {20: "least_tried", 30: "curious"}
    assert np.array_equal(continued.plan()[1], whole.plan()[1])


def test_an_explorer_that_ignores_the_agent_s_goal_is_not_changed_to():
    space = arm()
    agent = CuriousAgent(space, InstantPlant(space.robot), goal=[3])
    with pytest.raises(InvalidValue, match="ignores a goal"):
        agent.explore_by("random")
    with pytest.raises(UnknownName, match="Did you mean 'random'"):
        agent.explore_by("randon")
    assert agent.explorer == "curious"


def test_a_transition_is_on_disk_before_the_next_action(tmp_path):
    path = tmp_path / "run.sqlite"
    seen = []

    class Looking(InstantPlant):
        def act(self, part, target):
            with TransitionStore(path, part) as other:
                seen.append(len(other.load()))
            return super().act(part, target)

    CuriousAgent(torso(), Looking(toy_robot()), store=TransitionStore(path, "torso")).run(5)
    assert seen == [0, 1, 2, 3, 4]


def test_a_transition_that_cannot_be_written_is_not_learnt(tmp_path):
    agent = CuriousAgent(torso(), InstantPlant(toy_robot()), store=TransitionStore(tmp_path / "run.sqlite", "torso"))
    agent.run(3)
    agent.store.close()
    with pytest.raises(MobeeError, match=r"run\.sqlite"):
        agent.step()
    assert agent.transitions == agent.model.tries.sum() == 3


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"seed": 1}, "seed"),
        ({"discount": 0.5}, "discount"),
        ({"initial": "60-40"}, "initial"),
        ({"explorer": "random"}, "explorer"),
        ({"divergence": "kl"}, "divergence"),
        ({"forgetting": 0.99}, "forgetting"),
        ({"tolerance": 1e-3}, "tolerance"),
        ({"relative": False}, "relative"),
        ({"beliefs": "debiased"}, "beliefs"),
    ],
)
def test_a_store_made_under_other_settings_is_refused(tmp_path, changed, key):
    def make(**options):
        return CuriousAgent(torso(), InstantPlant(toy_robot()), store=TransitionStore(tmp_path / "run.sqlite", "torso"), **options)

    make().run(2)
    with pytest.raises(MobeeError, match=rf"run\.sqlite: torso has {key} = .* on record.*another file"):
        make(**changed)


def test_a_store_of_another_space_is_refused(tmp_path):
    path = tmp_path / "run.sqlite"
    CuriousAgent(arm(), InstantPlant(toy_robot()), store=TransitionStore(path, "left_arm")).run(1)
    with pytest.raises(MobeeError, match="left_arm has space = .* on record"):
        CuriousAgent(arm(tie_seed=1), InstantPlant(toy_robot()), store=TransitionStore(path, "left_arm"))


def on_a_table(path, fails=False):
    space = torso()
    outcomes, probabilities = ideal(space)
    plant = TabularPlant(space, np.zeros_like(outcomes) if fails else outcomes, probabilities)
    return CuriousAgent(space, plant, store=TransitionStore(path, "torso"))


def test_a_store_made_on_another_plant_is_refused(tmp_path):
    path = tmp_path / "run.sqlite"
    on_a_table(path).run(2)
    assert on_a_table(path).transitions == 2
    with pytest.raises(MobeeError, match=r"torso has plant = \{.table.: .*\} on record, now \{.table.: .*another file"):
        on_a_table(path, fails=True)


def test_a_record_without_plant_settings_is_not_continued_on_a_plant_that_has_some(tmp_path):
    path = tmp_path / "run.sqlite"
    CuriousAgent(torso(), InstantPlant(toy_robot()), store=TransitionStore(path, "torso")).run(2)
    assert CuriousAgent(torso(), InstantPlant(toy_robot()), store=TransitionStore(path, "torso")).transitions == 2
    with pytest.raises(MobeeError, match="torso has no plant on record.*does not say what it is.*mobee plan.*another file"):
        on_a_table(path)


def test_an_interrupted_action_is_not_observed_and_the_agent_measures_again(tmp_path):
    agent = CuriousAgent(torso(), Interrupting(toy_robot(), {2}), store=TransitionStore(tmp_path / "run.sqlite", "torso"))
    agent.step()
    with pytest.raises(ActionInterrupted):
        agent.step()
    assert agent.transitions == len(agent.store.load()) == 1
    assert agent.state == 0 != agent.last.s_next
    agent.step()
    assert agent.last.s == 0 and agent.transitions == 2


class LostAfterMoving(InstantPlant):
    """Moves, and is interrupted before it returns an outcome, at its third action."""

    def __init__(self, robot):
        super().__init__(robot)
        self.actions = 0

    def act(self, part, target):
        self.actions += 1
        outcome = super().act(part, target)
        if self.actions == 3:
            raise KeyboardInterrupt
        return outcome


def test_after_ctrl_c_the_agent_measures_its_state():
    agent = CuriousAgent(torso(), LostAfterMoving(toy_robot()))
    with pytest.raises(KeyboardInterrupt):
        agent.run(5)
    assert agent.transitions == 2
    assert agent.state == agent.space.state_of(agent.plant.measure("torso")) != agent.last.s_next
    agent.run(1)
    assert agent.last.s_next == agent.space.goal(agent.last.s, agent.last.a)


def test_after_ctrl_c_agents_that_run_together_measure_their_states():
    plant = ToyConcurrent(toy_robot(), {"torso": 1.0})
    agent = CuriousAgent(torso(), plant)
    run([agent], 3)
    advance = plant.advance

    def interrupted():
        advance()
        raise KeyboardInterrupt

    plant.advance = interrupted
    with pytest.raises(KeyboardInterrupt):
        run([agent], 1)
    assert agent.transitions == 3 and agent.state == agent.space.state_of(plant.measure("torso"))


@pytest.mark.parametrize("written", [True, False])
def test_an_interrupted_write_is_learnt_if_it_is_on_disk(tmp_path, written, monkeypatch):
    agent = CuriousAgent(torso(), InstantPlant(toy_robot()), store=TransitionStore(tmp_path / "run.sqlite", "torso"))
    agent.run(3)
    append = agent.store.append

    def interrupted(transition):
        if written:
            append(transition)
            agent.store._last -= 1  # as if the interrupt had come within the call
        raise KeyboardInterrupt

    monkeypatch.setattr(agent.store, "append", interrupted)
    with pytest.raises(KeyboardInterrupt):
        agent.run(1)
    monkeypatch.undo()
    assert agent.state == agent.space.state_of(agent.plant.measure("torso"))
    agent.run(2)
    stored = agent.store.load()
    assert len(stored) == agent.transitions == agent.model.tries.sum() == 5
    assert all(before.s_next == after.s for before, after in zip(stored[3:], stored[4:], strict=False))


def test_a_run_continues_after_interruptions():
    agent = CuriousAgent(torso(), Interrupting(toy_robot(), {1, 3, 4}))
    agent.run(5)
    assert agent.transitions == 5 and agent.plant.actions == 8


@pytest.mark.parametrize("count", [2.5, -1, True, "3", float("nan")])
def test_a_number_of_transitions_that_is_no_count_is_refused(count):
    plant = ToyConcurrent(toy_robot(), {})
    agent = CuriousAgent(torso(), plant)
    for start in (agent.run, lambda wanted: run([agent], wanted)):
        with pytest.raises(InvalidValue, match=f"transitions={count!r}: give a whole number"):
            start(count)
    assert agent.transitions == 0


def test_a_plant_of_another_robot_is_refused():
    class Other:
        name, motors = "katana", ("base",)

    plant = InstantPlant(toy_robot())
    plant.robot = Other
    with pytest.raises(InvalidValue, match="'katana', the space is of 'toy'"):
        CuriousAgent(torso(), plant)


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
def test_transitions_are_counted_over_all_agents_and_every_action_ends(total):
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
