from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import pytest

from experiments import babbling
from experiments.babbling.contacts import Touch
from experiments.babbling.measured import POSITIONS, Judged, Lockstep, Trial
from experiments.babbling.modes import FILTERED, MODES, scenario
from experiments.babbling.results import summarise, verdict
from experiments.babbling.table import as_table
from experiments.babbling.trial import TrialFailed
from mobee.errors import InvalidValue
from mobee_cli.__main__ import main

PARTS = ("torso", "head", "left_arm", "right_arm")


def trial(
    depths: tuple[float, ...] = (),
    completed: int = 4,
    jerk: float = 4.0,
    beyond: float = -0.1,
    seconds: float = 60.0,
    repeatable: bool = True,
) -> Trial:
    outcomes = {part: "completed" if i < completed else "deflected" for i, part in enumerate(PARTS)}
    left = {part: 0.1 if i < completed else 0.5 for i, part in enumerate(PARTS)}
    command = Judged(outcomes, dict.fromkeys(PARTS, "over"), left, 10.0, 12.0, 11.0)
    touches = [Touch("l_forearm table", 10 * i, 10 * i, depth) for i, depth in enumerate(depths)]
    return Trial(seconds, [command], touches, beyond, "torso_yaw", 0.25, jerk**2, 50.0, 12.0, Lockstep(3000, 8.0, repeatable, ""))


GOOD = {"off": trial((0.001, 0.003)), "one": trial(completed=1, jerk=9.0), "two": trial(completed=3)}


def rows(**changed: Trial) -> dict[str, dict[str, Any]]:
    return {mode: summarise([each]) for mode, each in {**GOOD, **changed}.items()}


def test_all_claims_stand_when_all_is_as_it_should_be() -> None:
    claims = verdict(rows())
    assert len(claims) == 5
    assert all(claims.values())


@pytest.mark.parametrize(
    ("mode", "spoiled", "claim"),
    [
        ("off", trial(), "without MoBeE it collides"),
        ("off", trial((0.001,), seconds=7200.0), "without MoBeE it collides"),
        ("two", trial((0.0021,), completed=3), "no listed contact is deeper"),
        ("two", trial(completed=3, beyond=0.01), "no joint is beyond"),
        ("one", trial(completed=3, jerk=9.0), "completes a larger share"),
        ("one", trial(completed=1, jerk=3.0), "moves more smoothly"),
    ],
)
def test_a_claim_falls_with_what_contradicts_it(mode: str, spoiled: Trial, claim: str) -> None:
    fallen = [name for name, stands in verdict(rows(**{mode: spoiled})).items() if not stands]
    assert len(fallen) == 1
    assert claim in fallen[0]


def test_of_one_mode_only_its_own_claims_are_judged() -> None:
    assert len(verdict({"two": summarise([GOOD["two"]])})) == 2
    assert not verdict({"one": summarise([GOOD["one"]])})


def test_trials_add_up() -> None:
    row = summarise([trial((0.001,), jerk=3.0, seconds=60.0), trial((0.004, 0.0), completed=1, jerk=5.0, seconds=120.0, beyond=0.0)])
    assert (row["minutes"], row["collisions"], row["deepest_mm"], row["worst_beyond_limit_deg"]) == (3.0, 3, 4.0, 0.0)
    assert (row["trials"], row["times_real_time"]) == (2, 8.0)
    assert (row["commands"], row["completed"], row["deflected"], row["postures_completed"]) == (8, 5, 3, 1)
    assert (row["within_5_deg"], row["left_median_deg"]) == (0, 5.73)
    assert row["jerk_rms"] == pytest.approx(((9.0 + 2 * 25.0) / 3.0) ** 0.5, abs=0.01)
    assert row["jerk_over_speed"] == pytest.approx(row["jerk_rms"] / 0.5, abs=0.1)
    assert row["path_a_minute_rad"] == 8.0


def test_the_table_has_80_columns_and_a_line_a_pair() -> None:
    many = trial(tuple(0.001 for _ in range(1234)), seconds=7200.0)
    lines = as_table(rows(off=many)).splitlines()
    assert max(len(line) for line in lines) <= 80
    assert any("l_forearm - table" in line and "1234" in line for line in lines)


def test_a_finished_run_is_told_as_a_table_with_what_is_judged_below(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(babbling, "_run_until_repeatable", lambda *settings: None)
    monkeypatch.setattr(babbling, "read_trials", lambda folder, mode: [GOOD[mode]])
    assert main(["experiment", "run", "babbling", "--minutes", "1", "--runs", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "collisions (solid contacts)" in said and "passed: yes" in said
    assert "2.0 moves more smoothly than 1.0: yes" in said
    assert all(len(line) <= 80 for line in said.splitlines() if not line.startswith("run: "))


def test_minutes_are_cut_into_trials() -> None:
    assert babbling.trial_lengths(120.0, 10.0) == [10.0] * 12
    assert babbling.trial_lengths(25.0, 10.0) == [10.0, 10.0, 5.0]
    assert babbling.trial_lengths(1.0, 10.0) == [1.0]


def test_every_mode_is_a_scenario_that_the_launcher_accepts(tmp_path: Path) -> None:
    from services.launcher.scenario import read_scenario

    for mode in MODES:
        file = tmp_path / f"{mode}.toml"
        file.write_text(scenario(mode, tmp_path / 'a "quoted" folder', seed=3, ticks=3000))
        read = {part.who: part.config for part in read_scenario(str(file)).parts}
        assert read["robot_sim"].mode == read["babbler"].mode == "lock" and read["robot_sim"].ticks == 3000
        assert read["robot_sim"].record == read["babbler"].run_dir
        assert ("controller" in read, "port_filter" in read) == (mode == "two", mode == "one")
        if mode == "two":
            assert (read["model"].gains, read["controller"].gains, read["controller"].speed_scale) == ("default", "default", 0.2)
        if mode == "one":
            assert read["babbler"].robot_of == read["port_filter"].clients == FILTERED


class Trials:
    """In place of real ones: notes which are run, leaves what they would, and breaks off where it is told."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.run: list[tuple[str, int, int]] = []
        self.breaks_at = 99
        monkeypatch.setattr(babbling, "run_trial", self._run)
        self.late = 0  # in so many of the next trials somebody is late
        monkeypatch.setattr(babbling, "measure", self._measure)

    def _measure(self, folder: Path, robot: Any, dt: float) -> Trial:
        self.late -= 1
        return trial(repeatable=False) if self.late >= 0 else GOOD[folder.parent.name]

    def _run(self, folder: Path, mode: str, robot: Any, seed: int, ticks: int, show: Any) -> None:
        if len(self.run) == self.breaks_at:
            raise TrialFailed("broken off")
        self.run.append((mode, seed, ticks))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / POSITIONS).write_bytes(b"much")


def options(**changed: Any) -> argparse.Namespace:
    return argparse.Namespace(**{"minutes": 15.0, "trial": 10.0, "modes": list(MODES), "seed": 2, "json": False, **changed})


def test_a_run_that_was_broken_off_goes_on_behind_its_finished_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trials = Trials(monkeypatch)
    trials.breaks_at = 4
    with pytest.raises(TrialFailed):
        babbling.run(options(), tmp_path)
    trials.breaks_at = 99
    results = babbling.run(options(), tmp_path)
    assert trials.run == [(mode, 20_000 + number, ticks) for number, ticks in ((0, 30_000), (1, 15_000)) for mode in MODES]
    assert results["passed"] and "modes" not in results
    assert "MoBeE 2.0" in capsys.readouterr().out
    assert not list(tmp_path.rglob(POSITIONS))
    again = babbling.run(options(json=True), tmp_path)
    assert len(trials.run) == 6
    assert again["modes"]["two"]["commands"] == 8


def test_a_trial_in_which_somebody_was_late_is_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    trials = Trials(monkeypatch)
    trials.late = 2
    babbling.run(options(minutes=1.0, modes=["two"], json=True), tmp_path)
    assert trials.run == [("two", 20_000, 3000)] * 3
    assert babbling.read_trials(tmp_path, "two") == [GOOD["two"]]
    trials.late = 3
    with pytest.raises(TrialFailed, match="too busy"):
        babbling.run(options(minutes=1.0, modes=["one"], json=True), tmp_path)
    assert not babbling.read_trials(tmp_path, "one")


def test_the_figure_is_drawn_of_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    with pytest.raises(InvalidValue, match="no finished trial"):
        babbling.figure(tmp_path)
    Trials(monkeypatch)
    babbling.run(options(modes=["off", "two"], json=True), tmp_path)
    assert babbling.figure(tmp_path).read_bytes().startswith(b"\x89PNG")
