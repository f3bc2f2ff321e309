# SPDX-License-Identifier: Apache-2.0
"""`mobee keys`: what it makes and says, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mobee_cli.__main__ import main
from services.launcher.scenario import read_scenario, shipped


def test_keys_are_made_listed_added_and_renewed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "keys"
    assert main(["keys", "new", str(folder), "--parts", "arm", "--days", "100"]) == 0
    said = capsys.readouterr().out
    assert f"\n  mobee launch --secure --keys {folder}\n" in said
    assert "valid for 100 days" in said
    assert all(len(line) <= 80 or str(folder) in line for line in said.splitlines())
    assert main(["keys", "add", "--keys", str(folder), "tool", "robot_sim", "--days", "10"]) == 0
    assert capsys.readouterr().out.startswith("made tool (client) in")
    assert main(["keys", "add", "--keys", str(folder), "mine", "--as", "driver"]) == 0
    capsys.readouterr()
    assert main(["keys", "list", "--keys", str(folder), "--json"]) == 0
    rows = {row["name"]: (row["party"], row["days_left"]) for row in json.loads(capsys.readouterr().out)}
    assert rows["agent_arm"] == ("agent", 99)
    assert rows["robot_sim"] == ("robot_sim", 9)
    assert rows["tool"] == ("client", 9)
    assert rows["mine"] == ("driver", 364)
    assert rows["router"] == ("router", 99)
    assert main(["keys", "list", "--keys", str(folder)]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


def test_new_keys_hold_an_identity_for_each_service_of_the_shipped_scenarios(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "new", str(tmp_path / "keys")]) == 0
    capsys.readouterr()
    assert main(["keys", "list", "--keys", str(tmp_path / "keys"), "--json"]) == 0
    made = {row["name"] for row in json.loads(capsys.readouterr().out)}
    needed = {part.who for name in shipped() for part in read_scenario(name).parts}
    assert {"cup", "agent_torso", "robot_sim"} <= needed <= made


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["new", "{folder}"], 3, "holds files already"),
        (["new", "{folder}/x", "--days", "0"], 2, "give 1 to 3650 days"),
        (["add", "--keys", "{folder}", "model", "--as", "client"], 2, "model is the name of a service"),
        (["add", "--keys", "{folder}", "a b"], 2, "cannot name an identity"),
        (["list", "--keys", "{folder}/none"], 3, "`mobee keys new` makes a folder of keys"),
    ],
)
def test_mistakes_are_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, said: str
) -> None:
    folder = tmp_path / "keys"
    assert main(["keys", "new", str(folder)]) == 0
    capsys.readouterr()
    assert main(["keys", *(word.format(folder=folder) for word in arguments)]) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert said in printed.err
    assert printed.err.count("\n") == 1


def test_a_wrong_name_makes_and_renews_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "keys"
    assert main(["keys", "new", str(folder), "--parts", "torso", "left-arm"]) == 2
    assert "'agent_left-arm' cannot name an identity" in capsys.readouterr().err
    assert not folder.exists()
    assert main(["keys", "new", str(folder), "--parts", "torso", "left_arm"]) == 0
    before = {path: path.read_bytes() for path in folder.iterdir()}
    assert main(["keys", "add", "--keys", str(folder), "model", "a/b"]) == 2
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
