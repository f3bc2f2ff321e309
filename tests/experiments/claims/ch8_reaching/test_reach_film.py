# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.claims.ch8_reaching.reach_film import episodes, learn, main, selected, table_plant
from mobee.learning.reaching.record import load_reaches
from mobee.reach import TARGET


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("film") / "run.sqlite"
    learn(file, 0, tries=10, transitions=80)
    return file


def test_episodes_show_the_target_and_end_with_the_hand_at_it_and_do_not_change_the_file(run: Path) -> None:
    before, plant = run.read_bytes(), table_plant(1)
    agent = load_reaches(run, plant)
    found = episodes(agent, plant, 4, 0)
    assert found
    for one in found:
        for objects in one.motion.objects:
            np.testing.assert_array_equal(objects[TARGET].position, one.target.position)
        away = np.linalg.norm(one.motion.path(agent.marker) - one.target.position, axis=1)
        assert away[-1] <= one.target.radius + 0.025 and (away[:-1] > away[-1]).all()
    assert run.read_bytes() == before


def test_the_command_draws_reaches_of_a_recorded_learner(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr("experiments.claims.ch8_reaching.reach_film.EPISODES", 4)
    main([str(run), "--out", str(tmp_path / "film.png"), "--poses", "2", "--height", "30"])
    assert (tmp_path / "film.png").stat().st_size > 1000
    assert "From above: state" in capsys.readouterr().out


STRAIGHT = np.linspace([-0.3, 0.0, 0.0], [-0.3, 0.3, 0.0], 20)
FAR = np.linspace([-0.3, 0.0, 0.0], [-0.3, 0.5, 0.0], 20)
ABOVE = np.linspace([-0.2, 0.3, 0.3], [-0.2, 0.3, 0.1], 20)
TURNING = np.concatenate([STRAIGHT, STRAIGHT[::-1] + [0.0, 0.0, 0.05]])
SHORT = np.linspace([-0.3, 0.0, 0.0], [-0.3, 0.05, 0.0], 20)


def test_one_path_of_each_kind_is_selected() -> None:
    found = selected([STRAIGHT, SHORT, ABOVE, TURNING, FAR])
    assert found == {"From above": 2, "Far": 4, "Around the target": 3}


def test_no_path_is_selected_twice_and_short_paths_never() -> None:
    assert selected([SHORT]) == {}
    assert selected([SHORT, FAR]) == {"From above": 1}
