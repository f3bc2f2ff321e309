# SPDX-License-Identifier: Apache-2.0
"""`mobee detector train`: the file, what is printed, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mobee.vision.objects.learned.network import load_network
from mobee_cli.__main__ import main


def test_a_detector_is_trained_written_and_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "ball.onnx"
    assert main(["detector", "train", str(file), "--world", "table", "--pictures", "3", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in printed["things"]] == [one.name for one in load_network(file).things] == ["ball"]
    assert printed["held_out"].keys() == {"learned", "by colour"}
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["things.pt"], "its name must end in .onnx"),
        (["none/things.onnx"], "no folder in which you may write"),
        (["things.onnx", "--world", "none"], "no target with a colour"),
        (["things.onnx", "--seed", "-1"], "--seed -1: must be 0 or more"),
        (["things.onnx", "--robot", "katana"], "has no camera"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    options: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["detector", "train", *options]) == 2
    said = capsys.readouterr().err
    assert says in said and len(said.splitlines()) == 1
    assert not list(tmp_path.iterdir())
