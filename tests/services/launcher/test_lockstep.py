# SPDX-License-Identifier: Apache-2.0
"""What the launcher makes of a scenario in lockstep, before anything is started."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.common.config import ConfigError
from services.launcher.checks import check_lockstep, check_rate, check_robots
from services.launcher.scenario import Scenario, read_scenario
from services.launcher.summary import as_text, summarise
from tests.services.launcher.test_summary import RUN, child


def participants(scenario: Scenario) -> tuple[str, ...]:
    sim = next(part for part in scenario.parts if part.who == "robot_sim")
    return sim.config.participants


def test_robot_sim_waits_for_all_services_that_affect_the_robot() -> None:
    scenario = read_scenario("lockstep")
    assert scenario.is_locked
    assert participants(scenario) == ("model", "controller", "agent_torso", "agent_left_arm", "agent_right_arm")
    assert all(part.config.mode == "lock" for part in scenario.parts)


def test_any_scenario_runs_in_lockstep_without_its_real_time_services() -> None:
    scenario = read_scenario("default", ["shared.mode=lock"])
    check_lockstep(scenario)
    names = [part.who for part in scenario.parts]
    assert "monitor" in names
    assert not {"vision", "renderer"} & set(names)
    assert "monitor" not in participants(scenario)


def test_in_free_mode_no_service_is_waited_for() -> None:
    scenario = read_scenario("default")
    assert not scenario.is_locked
    assert participants(scenario) == ()


def test_the_participants_may_be_set() -> None:
    assert participants(read_scenario("lockstep", ['services.robot_sim.participants=["model"]'])) == ("model",)


def test_another_namespace_is_waited_for_by_its_filter(tmp_path: Path) -> None:
    assert "agent_torso" not in participants(read_scenario("lockstep", ["services.agent_torso.namespace=icub_filtered"]))


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["services.model.mode=free"], "model free"),
        (["shared.mode=free", "services.robot_sim.ticks=10"], "set shared.mode=lock"),
    ],
)
def test_what_cannot_keep_step_is_refused(settings: list[str], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        check_lockstep(read_scenario("lockstep", settings))


def test_a_misspelt_joint_of_an_agent_is_found_before_anything_starts() -> None:
    with pytest.raises(ConfigError, match="torso has no motor 'torso_yam'.*Did you mean 'torso_yaw'"):
        check_robots(read_scenario("lockstep", ['services.agent_torso.joints=["torso_yam"]']))


def test_the_summary_says_whether_the_run_can_be_repeated_and_what_its_states_were() -> None:
    numbers = {"tick": 500.0, "flaws": 0.0, "speed": 20.5, "ticks": 500.0}
    summary = RUN | summarise([child("robot_sim", numbers, words={"states": "ab12"})])
    assert summary["lockstep"] == {"ticks": 500, "speed": 20.5, "repeatable": True, "states_sha256": "ab12"}
    assert "500 ticks at 20.5 x real time; repeatable" in as_text(summary)
    spoilt = RUN | summarise([child("robot_sim", numbers | {"flaws": 2.0})])
    assert not spoilt["lockstep"]["repeatable"]
    assert "not repeatable" in as_text(spoilt)
    assert (RUN | summarise([]))["lockstep"] is None


def test_a_rate_at_which_the_controller_would_answer_nothing_is_refused() -> None:
    def check(*settings: str) -> None:
        scenario = read_scenario("lockstep", settings)
        check_rate(scenario, check_robots(scenario))

    check()
    with pytest.raises(ConfigError, match="services.robot_sim.rate.*rate 5 Hz: gains unstable at steps of 0.2 s"):
        check("services.robot_sim.rate=5")
