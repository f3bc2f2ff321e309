# SPDX-License-Identifier: Apache-2.0
"""MoBeE/Table-v0: several parts of one robot, by PettingZoo's parallel API."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

import mobee
from mobee.gymnasium import TableEnv
from mobee.simulation import PlantSettings

PUBLISHED = PlantSettings(gains=mobee.Gains.published_2014(), dt=0.02)


def made() -> TableEnv:
    return TableEnv(steps=12, plant=PUBLISHED, reward="gain")


def test_pettingzoo_finds_nothing_wrong() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(made(), num_cycles=30)
        parallel_seed_test(made, num_cycles=15)


def test_agents_act_as_those_of_the_library_do() -> None:
    env = made()
    seen, infos = env.reset(seed=1)
    plant = mobee.OfflinePlant(
        mobee.Model(mobee.load_robot("icub"), mobee.load_world("table")), env.plant.motors.seed, settings=PUBLISHED, active=env.agents
    )
    agents = {part: mobee.CuriousAgent(env.spaces[part], plant) for part in env.agents}
    begun: set[str] = set()
    for _ in range(12):
        chosen = dict.fromkeys(agents, 0)
        for part in agents:
            if infos[part]["ready"]:
                assert part not in begun and infos[part]["action_mask"].all()
                chosen[part] = agents[part].decide(seen[part])
                plant.begin(part, agents[part].target(chosen[part]))
                begun.add(part)
            else:
                assert not infos[part]["action_mask"].any()
        seen, rewards, _, cut, infos = env.step(chosen)
        for part, outcome in plant.advance():
            begun.remove(part)
            assert infos[part]["ready"] and np.array_equal(infos[part]["q"], outcome.q)
            assert rewards[part] == agents[part].observe(outcome)
        assert {part for part in agents if rewards[part] == 0.0} == begun
    assert all(cut.values()) and env.agents == []


def test_a_part_whose_action_does_not_exist_rests() -> None:
    env = TableEnv(parts={"torso": ("torso_yaw", "torso_pitch")}, neighbours={"torso": 3}, plant=PUBLISHED)
    seen, _ = env.reset(seed=0)
    after, _, _, _, infos = env.step({"torso": 7})
    assert after == seen and env.plant.time == 0.0 and infos["torso"]["ready"]


def test_an_action_of_an_unknown_agent_or_of_a_fraction_is_refused() -> None:
    env = TableEnv()
    env.reset(seed=0)
    with pytest.raises(mobee.UnknownName, match="unknown agent 'left_arn'. Did you mean 'left_arm'"):
        env.step({"left_arn": 1})
    with pytest.raises(mobee.InvalidValue, match="action 1.5: give a whole number"):
        env.step({"torso": 1.5})  # type: ignore[dict-item]
    assert env.plant.time == 0.0


def test_joints_of_another_part_are_refused() -> None:
    with pytest.raises(mobee.InvalidValue, match="give motors of torso"):
        TableEnv(parts={"torso": ("l_elbow", "l_shoulder_yaw")})


def test_neighbours_of_another_part_and_episodes_without_steps_are_refused() -> None:
    arm = {"left_arm": ("l_elbow", "l_shoulder_yaw")}
    with pytest.raises(mobee.UnknownName, match="left_arm"):
        TableEnv(parts=arm, neighbours={"left_arn": 2})
    with pytest.raises(mobee.InvalidValue, match="steps"):
        TableEnv(parts=arm, steps=0)
    with pytest.raises(mobee.InvalidValue, match="steps=2.5"):
        TableEnv(parts=arm, steps=2.5)
    assert TableEnv(parts=arm, neighbours={"left_arm": 2}).action_space("left_arm").n == 2
