# SPDX-License-Identifier: Apache-2.0
"""Ticks of a recording, and where two recordings part."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import MobeeError
from mobee_cli.__main__ import main
from mobee_cli.replaying.differences import OF_THE_RUN, compare_runs, difference
from mobee_cli.replaying.into import replay_into
from mobee_cli.replaying.ticks import SLACK, ticks
from services.recorder.reader import Recording
from tests.services.recorder.recordings import Writer, message

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(st.text(max_size=3), VALUES, max_size=4))
def test_a_message_does_not_differ_from_itself(content: dict[str, Any]) -> None:
    assert difference(0, "a", content, json.loads(json.dumps(content))) is None


@given(st.lists(st.floats(allow_nan=False), min_size=1), st.data())
def test_a_changed_number_is_found_at_its_place(numbers: list[float], data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(numbers) - 1))
    other = data.draw(st.floats(allow_nan=False).filter(lambda x: x.hex() != numbers[at].hex()))
    changed = [*numbers[:at], other, *numbers[at + 1 :]]
    found = difference(7, "tick", {"k": 7, "q": numbers}, {"k": 7, "q": changed}, OF_THE_RUN)
    assert found is not None
    assert (found.tick, found.key, found.field) == (7, "tick", f"q[{at}]")
    assert found.first.hex() == numbers[at].hex() and found.second.hex() == other.hex()  # 0.0 and -0.0 differ too


def recorded(folder: Path, ref_of_5: float = 0.5, lost: int = -1, last: int = 40) -> Path:
    """A run of which tick 0 is repeated; `lost`: a tick whose commands the recorder did not get."""
    folder.mkdir()
    writer = Writer(folder)
    for _ in range(3):
        writer.tick(0, q=[0.0])
    for k in range(1, last + 1):
        writer.tick(k, q=[0.1 * k])
        if k != lost:
            writer.add("commands", "Commands", message(k, src="controller", ref=[ref_of_5 if k == 5 else 0.1], parts={"arm": {"epoch": k}}))
    writer.files.close()
    return folder


def test_ticks_hold_their_messages_and_the_last_is_left_out(tmp_path: Path) -> None:
    found = list(ticks(Recording(recorded(tmp_path / "a"))))
    assert [tick.k for tick in found] == list(range(40))
    assert [len(tick.items) for tick in found] == [3, *[2] * 39]


def test_a_late_message_is_placed_by_its_tick_and_one_of_another_run_is_not(tmp_path: Path) -> None:
    writer = Writer(tmp_path)
    for k in range(3):
        writer.tick(k)
    writer.add("agents/arm/transition", "Transition", message(1, src="agent_arm"))
    writer.add("event/x", "Event", message(1, src="x", run="run_0"))
    writer.add("alive", "", b'{"who": "x", "instance": "1", "up": true}')
    for k in range(3, 3 * SLACK):
        writer.tick(k)
    writer.add("event/x", "Event", message(1, src="x"))  # when its tick has been read
    writer.tick(0, run="run_2")
    writer.files.close()
    found = list(ticks(Recording(tmp_path)))
    assert [item.key for item in found[1].items] == ["tick", "agents/arm/transition"]
    assert [item.key for item in found[2].items] == ["tick", "alive"]
    assert len(found) == 3 * SLACK - 1


def test_two_runs_part_at_the_first_difference(tmp_path: Path) -> None:
    first = Recording(recorded(tmp_path / "a"))
    assert compare_runs(first, Recording(recorded(tmp_path / "b"))).difference is None
    found = compare_runs(first, Recording(recorded(tmp_path / "c", ref_of_5=0.25)))
    assert (found.ticks, str(found.difference)) == (4, "tick 5, commands, ref[0]: 0.5 and 0.25")
    assert compare_runs(first, Recording(recorded(tmp_path / "d", last=30))).ends == "second"
    lost = compare_runs(first, Recording(recorded(tmp_path / "e", lost=9))).difference
    assert lost is not None and (lost.tick, lost.key, lost.second) == (9, "commands", "missing")


def test_the_command_says_where_they_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = str(recorded(tmp_path / "a")), str(recorded(tmp_path / "b", ref_of_5=0.25))
    assert main(["replay", one, "--diff", one]) == 0
    assert "equal to the last bit in 39 ticks" in capsys.readouterr().out
    assert main(["replay", one, "--diff", other, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["difference"] == {
        "tick": 5,
        "key": "commands",
        "field": "ref[0]",
        "first": 0.5,
        "second": 0.25,
    }
    assert main(["replay", one, "--into", "controller"]) == 2
    assert "holds no controller.toml" in capsys.readouterr().err


def test_recordings_without_a_whole_tick_are_not_called_equal(tmp_path: Path) -> None:
    short = Recording(recorded(tmp_path / "a", last=1))
    with pytest.raises(MobeeError, match="nothing was compared"):
        compare_runs(short, short)


def test_a_recording_without_a_robot_has_no_ticks(tmp_path: Path) -> None:
    writer = Writer(tmp_path)
    writer.add("event/x", "Event", message(1, src="x"))
    writer.files.close()
    with pytest.raises(MobeeError, match="no tick"):
        list(ticks(Recording(tmp_path)))


@pytest.mark.parametrize(
    ("first", "mode", "says"),
    [
        (7, "free", "was not in lockstep .* record one with `mobee launch lockstep`"),
        (0, "free", "was not in lockstep"),
        (7, "lock", "does not begin at tick 0"),
    ],
)
def test_a_run_that_cannot_be_played_into_a_service_is_refused_with_the_reason(first: int, mode: str, says: str, tmp_path: Path) -> None:
    writer = Writer(tmp_path)
    for k in range(first, first + 40):
        writer.tick(k, mode=mode)
    writer.files.close()
    stage: Any = SimpleNamespace(who="controller")
    with pytest.raises(MobeeError, match=says):
        replay_into(stage, ticks(Recording(tmp_path)), 10)
