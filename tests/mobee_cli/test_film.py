# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee_cli.__main__ import main
from services.monitor.film import film
from services.monitor.past import Story
from tests.mobee_cli.test_replay import recorded

Image = pytest.importorskip("PIL.Image")
pytest.importorskip("matplotlib")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run of ten seconds, and films of a second."""
    monkeypatch.setattr(film, "LENGTH", 1.0)
    folder = recorded(tmp_path)
    robot = {"name": "arm", "parts": [{"name": "arm", "color": [255, 0, 0]}], "shapes": []}
    last = {"outcome": "It got there.", "surprise": "Surprise 0.69 nats.", "reached": True}
    card = {"part": "arm", "title": "arm", "now": "pan +10°. 1st try from here.", "n": 3, "tried": 0.2, "predictable": 0.1, "last": last}
    logged: list[tuple[float, str, Any]] = [(0.0, "robot", robot), (0.0, "cards", [card])]
    logged += [(0.0, "places", {"arm": {"link": 0, "marker": "tip", "points": [[-0.3, 0.0, 0.2], [-0.3, 0.1, 0.2]]}})]
    logged += [
        (0.0, "curves", {"arm": [[0, 0.0, 0.0], [3, 0.2, 0.1]]}),
        (0.0, "baselines", {"arm": {"random": [[0, 0.0, 0.0], [3, 0.1, 0.0]]}}),
    ]
    logged += [(0.0, "left", {"arm": {"left": [1.0, 0.1], "here": 0, "path": [1], "untried": [1, 0], "actions": [1, 1]}})]
    lines = [json.loads(line) for line in (folder / "story.jsonl").read_text().splitlines()]
    lines = [*logged, *(one for one in lines if one[1] == "q")]
    (folder / "story.jsonl").write_text("".join(json.dumps(one) + "\n" for one in lines))
    return folder


def test_a_film_shows_the_robot_in_motion_and_its_story(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["film", str(run)]) == 0
    assert capsys.readouterr().out == f"{run / 'film.gif'}: 0.0 MB\n"
    with Image.open(run / "film.gif") as made:
        assert (made.size, made.n_frames) == ((film.WIDTH, film.HEIGHT), 8)
        first = np.asarray(made.convert("RGB")).astype(int)
        made.seek(7)
        last = np.asarray(made.convert("RGB")).astype(int)
    assert (np.abs(last - first)[:, : film.ROBOT_WIDTH].max(axis=2) > 60).sum() > 200  # pixels: the arm has turned
    text = first[:120, film.ROBOT_WIDTH :].min(axis=2)
    assert (text > 150).sum() > 200


def test_an_mp4_is_written_too(run: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    assert main(["film", str(run), "--to", str(run / "film.mp4")]) == 0
    assert (run / "film.mp4").read_bytes()[4:8] == b"ftyp"


def test_another_kind_of_file_is_refused(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["film", str(run), "--to", str(run / "film.avi")]) == 2
    assert ".gif or a .mp4" in capsys.readouterr().err
    assert main(["film", str(run / "none")]) == 2


def test_between_two_recorded_poses_the_robot_moves_on_a_straight_line(run: Path) -> None:
    story = Story(run)
    assert story.pose(1.1).tolist() == pytest.approx([0.055, 0.5])
    assert story.pose(-1.0).tolist() == [0.0, 0.5]
    assert story.pose(99.0).tolist() == pytest.approx([0.5, 0.5])


def test_the_scenes_are_spread_over_the_run() -> None:
    moments = film.scene_times(1000.0)
    assert len(moments) == film.LENGTH * film.RATE
    assert moments[0] == 0.0 and 990.0 < moments[-1] < 1000.0
    assert np.diff(film.scene_times(4.0)).min() > 0.0  # a run that is shorter than the film
