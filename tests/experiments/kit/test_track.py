# SPDX-License-Identifier: Apache-2.0
"""What agents learn, as event files of TensorBoard, which are read back."""

from __future__ import annotations

import math
import struct
import sys
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from tensorboardX.crc32c import crc32c
from tensorboardX.proto.event_pb2 import Event, SessionLog

from experiments.kit.track import FOLDER, track_stores, tracked
from mobee import CuriousAgent, TransitionModel
from mobee.learning.discrete import DiscreteSpace
from mobee.learning.tabular import TabularPlant, river_swim
from mobee.learning.value_iteration import probability_of
from mobee.store import STORE, Transition, TransitionStore
from mobee_cli.__main__ import main
from tests.mobee.learning.toys import InstantPlant, torso
from tests.mobee_cli.test_learn import ARM

Curves = dict[str, dict[int, float]]


def events(folder: Path) -> list[Event]:
    """The events of all files of a folder, in the order in which they were written."""
    found = []
    for file in sorted(folder.glob("events.out.tfevents.*")):
        data = file.read_bytes()
        while data:
            head, (length,) = data[:8], struct.unpack("<Q", data[:8])
            body = data[12 : 12 + length]
            for part, mask in ((head, data[8:12]), (body, data[12 + length : 16 + length])):
                crc = crc32c(part)
                assert struct.unpack("<I", mask)[0] == ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF
            found.append(Event.FromString(body))
            data = data[16 + length :]
    return found


def curves(folder: Path) -> Curves:
    found: Curves = defaultdict(dict)
    for event in events(folder):
        for value in event.summary.value:
            found[value.tag][event.step] = value.simple_value
    return found


def begins(event: Event) -> bool:
    return bool(event.session_log.status == SessionLog.START and event.step == 0)


def river(store: TransitionStore | None = None) -> CuriousAgent:
    world = river_swim(4)
    space = DiscreteSpace(4, 2)
    return CuriousAgent(space, TabularPlant(space, world.outcomes, world.probabilities, seed=3), store=store)


def test_the_curves_of_an_agent_follow_from_its_transitions(tmp_path: Path) -> None:
    made: list[Transition] = []
    with tracked(tmp_path):
        agent = river()
        for _ in range(40):
            agent.step()
            assert agent.last is not None
            made.append(agent.last)
    found, model = curves(tmp_path / "environment"), TransitionModel(agent.space)
    ended = defaultdict[tuple[int, int], Counter[int]](Counter)
    for one in made:
        surprise = -math.log(max(probability_of(model, one.s, one.a, one.s_next), 1e-3))
        model.observe(one.s, one.a, one.s_next)
        ended[one.s, one.a][one.s_next] += 1
        sure = [counts for counts in ended.values() if counts.total() >= 2 and max(counts.values()) / counts.total() >= 0.8]
        expected = {"reward": one.reward, "surprise": surprise, "tried": len(ended) / 8, "predictable": len(sure) / 8, "robot_time": one.n}
        assert {tag: found[tag][one.n] for tag in found} == pytest.approx(expected, rel=1e-6)
    assert all(len(curve) == 40 for curve in found.values())
    agent.run(1)
    assert all(len(curve) == 40 for curve in curves(tmp_path / "environment").values())  # no longer tracked


def test_stores_below_a_run_give_the_curves_of_their_agents(tmp_path: Path) -> None:
    space = torso()
    (tmp_path / "launch").mkdir()
    with TransitionStore(tmp_path / "launch" / STORE, space.part) as store, tracked(tmp_path / "live"):
        CuriousAgent(space, InstantPlant(space.robot), store=store).run(10)
    track_stores(tmp_path, space.robot)
    assert curves(tmp_path / FOLDER / "launch" / space.part) == curves(tmp_path / "live" / space.part)


def test_learn_writes_curves_and_new_ones_when_it_continues(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = tmp_path / "arm.urdf"
    arm.write_text(ARM)
    for count in ("4", "7"):
        command = ["learn", "--robot", str(arm), "--store", str(tmp_path / "out.sqlite"), "--track", "tensorboard"]
        assert main([*command, "--transitions", count]) == 0
    assert capsys.readouterr().out.endswith(f"tensorboard --logdir {tmp_path / 'out-tensorboard'}\n")
    written = events(tmp_path / "out-tensorboard" / "arm")
    first, last = (max(k for k, event in enumerate(written) if what(event)) for what in (begins, lambda event: event.step == 1))
    assert first < last  # TensorBoard drops earlier values
    assert sorted(curves(tmp_path / "out-tensorboard" / "arm")["tried"]) == list(range(1, 8))


def test_an_experiment_writes_the_curves_and_numbers_of_each_trial(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["experiment", "run", "hypercube-exploration", "--quick", "--seeds", "1", "--jobs", "1", "--runs", str(tmp_path)]
    assert main([*command, "--track", "tensorboard"]) == 0
    (run,) = tmp_path.iterdir()
    assert f"tensorboard --logdir {run / FOLDER}" in capsys.readouterr().out
    cells = {path.stem for path in (run / "cells").glob("*.npz")}
    assert cells == {path.name for path in (run / FOLDER).iterdir()}
    for cell in cells:
        numbers, learned = curves(run / FOLDER / cell), curves(run / FOLDER / cell / "left_arm")
        assert len(learned["tried"]) == numbers["transitions"][0]
        assert learned["tried"][max(learned["tried"])] == 1.0


def test_without_the_package_the_option_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    for command in (["experiment", "run", "model-throughput"], ["learn", "--store", str(tmp_path / "x.sqlite"), "--transitions", "1"]):
        assert main([*command, "--track", "tensorboard"]) == 3
        said = capsys.readouterr()
        assert said.out == "" and said.err.count("\n") == 1 and 'pip install "mobee[track]"' in said.err
    assert list(tmp_path.iterdir()) == []
