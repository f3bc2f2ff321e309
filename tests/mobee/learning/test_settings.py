# SPDX-License-Identifier: Apache-2.0
"""One struct of settings an agent: its constructor, the scenario file, the record and the page come from it."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.agent import CuriousAgent
from mobee.learning.learner import CuriousSettings
from mobee.learning.reaching.learner import ReachSettings
from mobee.learning.reaching.predictors.local_averages import Nearest
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.learning.transitions import TransitionModel, kl_divergence
from mobee.simulation.plant import OfflinePlant, PlantSettings
from mobee.store import TransitionStore
from services.agents.config import TASK, Config
from services.common.config import ConfigError, read_toml
from tests.mobee.learning.reaching.toy import HANDS, SPACE, plant
from tests.mobee.learning.toys import InstantPlant, torso, toy_robot

PAGE = Path(__file__).parents[3] / "docs" / "agents.md"
BOTH = pytest.mark.parametrize(("agent", "settings"), [(CuriousAgent, CuriousSettings), (ReachAgent, ReachSettings)])


def curious(**options):
    return CuriousAgent(torso(), InstantPlant(toy_robot()), **options)


def reacher(**options):
    return ReachAgent(SPACE, plant(), marker="hand", hands=HANDS, **options)


def test_keywords_and_settings_make_the_same_agent():
    settings = CuriousSettings(discount=0.8, explorer="least_tried", seed=3)
    assert curious(settings=settings).settings == curious(discount=0.8, explorer="least_tried", seed=3).settings
    assert curious(settings=settings, discount=0.5).settings == curious(discount=0.5, explorer="least_tried", seed=3).settings
    reaching = ReachSettings(predictor="gp", limit=4)
    assert reacher(settings=reaching).settings == reacher(predictor="gp", limit=4).settings


def test_a_plant_takes_settings_and_keywords():
    model = mobee.Model(mobee.load_robot("katana"))
    settings = PlantSettings(dt=0.005, speed_scale=0.5)
    assert OfflinePlant(model, settings=settings).settings == OfflinePlant(model, dt=0.005, speed_scale=0.5).settings
    with pytest.raises(UnknownName, match="Did you mean 'speed_scale'"):
        OfflinePlant(model, speedscale=0.5)
    with pytest.raises(UnknownName, match="Did you mean 'velocity'"):
        PlantSettings(modality="velocty")


@pytest.mark.parametrize("make", [curious, reacher])
def test_an_unknown_setting_is_refused_with_the_nearest_name(make):
    with pytest.raises(UnknownName, match="Did you mean 'discount'"):
        make(discuont=0.9)


@pytest.mark.parametrize(
    ("make", "options", "message"),
    [
        (CuriousSettings, {"discount": 1.0}, "discount=1.0: valid is a number at least 0, below 1"),
        (CuriousSettings, {"forgetting": 0.0}, "forgetting=0.0: valid is a number above 0, at most 1"),
        (CuriousSettings, {"tolerance": float("inf")}, "tolerance=inf: valid is"),
        (CuriousSettings, {"tolerance": "fine"}, "tolerance='fine': valid is"),
        (CuriousSettings, {"beliefs": "debaised"}, "Did you mean 'debiased'"),
        (CuriousSettings, {"seed": None}, "seed=None: valid is a whole number, at least 0"),
        (CuriousSettings, {"seed": 1.5}, "seed=1.5: valid is a whole number, at least 0"),
        (CuriousSettings, {"seed": True}, "seed=True: valid is a whole number, at least 0"),
        (CuriousSettings, {"seed": -1}, "seed=-1: valid is a number at least 0"),
        (CuriousSettings, {"relative": "no"}, "relative='no': valid is True or False"),
        (PlantSettings, {"hashed": 1}, "hashed=1: valid is True or False"),
        (ReachSettings, {"seed": float("nan")}, "seed=nan: valid is a whole number, at least 0"),
        (ReachSettings, {"limit": 2.5}, "limit=2.5: valid is a whole number, at least 1"),
        (ReachSettings, {"limit": 0}, "limit=0: valid is a number at least 1"),
        (ReachSettings, {"penalty": 0.0}, "penalty=0.0: valid is a number below 0"),
        (ReachSettings, {"failures": "globally"}, "Valid: alike, local, spread"),
    ],
)
def test_values_are_checked_when_settings_are_made(make, options, message):
    with pytest.raises((InvalidValue, UnknownName), match=message):
        make(**options)


@pytest.mark.parametrize("seed", [2**63, 2**64, 10**400])
def test_a_seed_may_be_any_whole_number(seed):
    assert curious(seed=seed).settings["seed"] == reacher(seed=seed).settings["seed"] == seed
    curious(seed=seed, explorer="posterior_sampling").run(3)


def test_numbers_of_numpy_are_recorded_as_plain_ones(tmp_path):
    options = {"seed": np.int64(3), "discount": np.float32(0.5), "relative": np.bool_(False), "goal": [2], "goal_weight": np.float32(0.25)}
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        curious(store=store, **options).run(3)
        assert curious(store=store, seed=3, discount=0.5, relative=False, goal=[2], goal_weight=0.25).transitions == 3
    with ReachStore(tmp_path / "run.sqlite", SPACE.part) as store:
        reacher(store=store, scale=np.float32(0.25), limit=np.int16(4))
        assert store.settings()["scale"] == 0.25


@pytest.mark.parametrize(("agent", "settings"), [*BOTH.args[1], (OfflinePlant, PlantSettings)])
def test_the_signature_shows_every_setting_with_its_default(agent, settings):
    shown = inspect.signature(agent).parameters
    assert {one.name: one.default for one in fields(settings)} == {one.name: shown[one.name].default for one in fields(settings)}
    assert "changes" not in shown


@pytest.mark.parametrize(("agent", "settings"), [*BOTH.args[1], (OfflinePlant, PlantSettings)])
def test_settings_say_what_each_field_means(agent, settings):
    assert re.findall(r"^        (\w+): ", settings.__doc__, re.MULTILINE) == [one.name for one in fields(settings)]


@BOTH
def test_a_scenario_file_has_every_setting_with_the_same_default(agent, settings):
    config = Config()
    assert {one.name: getattr(config, one.name) for one in fields(settings) if one.name not in TASK} == {
        one.name: one.default for one in fields(settings) if one.name not in TASK
    }
    assert (config.curious() if settings is CuriousSettings else config.reaching()) == settings()


@BOTH
def test_the_page_lists_every_setting_with_its_default(agent, settings):
    rows = dict(re.findall(r"^\| `(\w+)` \| `([^`]*)` \|", PAGE.read_text(), re.MULTILINE))
    defaults = {one.name: repr(one.default) for one in fields(settings)}
    assert {name: repr(eval(rows[name])) for name in defaults} == defaults


def test_a_scenario_file_is_checked_line_by_line(tmp_path):
    file = tmp_path / "agent.toml"
    file.write_text('explorer = "my_module:mine"\ndivergence = "my_module:other"\ngoal = [3]\ngoal_weight = 0.5\nlimit = 4\n')
    config = read_toml(file, Config)
    assert config.curious() == CuriousSettings(explorer="my_module:mine", divergence="my_module:other", goal=(3,), goal_weight=0.5)
    assert config.reaching() == ReachSettings(limit=4)
    file.write_text("seed = 1\ndiscount = 1.0\n")
    with pytest.raises(ConfigError, match="agent.toml:2: discount"):
        read_toml(file, Config)


@pytest.mark.parametrize("kind", ["explorer", "divergence", "predictor", "strategy"])
def test_a_misspelt_name_in_a_scenario_is_refused_before_anything_starts(kind):
    with pytest.raises(UnknownName, match=f"unknown {kind} 'curios'"):
        Config(**{kind: "curios"}).check_robot(mobee.load_robot("icub"))


def absolute_change(after, before):
    """A divergence: half the L1 distance."""
    return float(np.abs(after - before).sum() / 2.0)


def test_a_divergence_may_be_a_function_or_its_name():
    model = TransitionModel(torso(), divergence=absolute_change)
    assert model.divergence == f"{__name__}:absolute_change"
    assert model.reward.max() == pytest.approx(abs(2 / 4 - 2 / 3))  # the second imagined outcome
    goal = model.space.goal(0, 0)
    assert model.gain(0, 0, goal) == model.observe(0, 0, goal) == model.reward[0, 0] == pytest.approx(3 / 5 - 2 / 4)
    elsewhere = next(state for state in range(27) if state not in (0, goal))
    assert model.observe(0, 0, elsewhere) == pytest.approx(2 / 7 - 1 / 6)
    one = curious(divergence=absolute_change)
    named = curious(divergence=one.settings["divergence"])
    one.run(10)
    named.run(10)
    assert one.last == named.last and one.settings == named.settings


@pytest.mark.parametrize("forgetting", [1.0, 0.8])
def test_kl_divergence_given_as_a_function_agrees_with_kail(forgetting):
    rng, shipped = np.random.default_rng(0), TransitionModel(torso(), forgetting=forgetting)
    given = TransitionModel(torso(), divergence=kl_divergence, forgetting=forgetting)
    np.testing.assert_allclose(given.reward, shipped.reward)
    for _ in range(200):
        seen = 0, int(rng.integers(3)), int(rng.integers(6))
        assert given.observe(*seen) == pytest.approx(shipped.observe(*seen), abs=1e-12)
    np.testing.assert_array_equal(given.probabilities, shipped.probabilities)


def test_a_divergence_that_returns_no_number_is_refused():
    with pytest.raises(InvalidValue, match="return a finite number"):
        TransitionModel(torso(), divergence=lambda after, before: None)
    with pytest.raises(InvalidValue, match="depleting cannot expect rewards"):
        curious(divergence=absolute_change, explorer="depleting").run(1)


def nearest_of(reaches):
    """Makes a predictor."""
    return Nearest(reaches)


@pytest.mark.parametrize("given", [Nearest, nearest_of, f"{__name__}:nearest_of", "nearest"])
def test_a_predictor_may_be_a_class_a_function_or_a_name(given):
    assert isinstance(reacher(predictor=given).predictor, Nearest)


def test_a_predictor_that_is_made_already_is_taken_as_it_is():
    made = Nearest(reacher().reaches)
    assert reacher(predictor=made).predictor is made
