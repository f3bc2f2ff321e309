# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import InvalidValue, MobeeError
from mobee.store import Transition, TransitionStore

ROOT = Path(__file__).parents[2]


def transition(n: int) -> Transition:
    return Transition(n, n % 81, n % 16, (n + 1) % 81, 0.1 / n, n % 7 > 0, 4.0 + n / 3, (n / 7, -0.1), ("table",) * (n % 2))


# Appends without end and reports each number only once `append` has returned.
APPENDER = """
import sys
from mobee.store import TransitionStore
from tests.mobee.test_store import transition
with TransitionStore(sys.argv[1], sys.argv[2]) as store:
    n = len(store.load())
    while n < int(sys.argv[3]):
        n += 1
        store.append(transition(n))
        print(n, flush=True)
"""


def appender(path, agent, until=10**9, **options):
    command = [sys.executable, "-c", APPENDER, str(path), agent, str(until)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT, **options)


def test_appended_transitions_are_loaded_unchanged(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, "torso") as store:
        for n in range(1, 30):
            store.append(transition(n))
        assert store.load() == [transition(n) for n in range(1, 30)]
    with TransitionStore(path, "torso") as store:
        assert store.load() == [transition(n) for n in range(1, 30)]
        store.append(transition(30))
        assert store.load()[-1] == transition(30)


def test_numbers_of_numpy_are_stored_as_plain_ones(tmp_path):
    given = Transition(*map(np.int64, (1, 2, 3, 4)), np.float32(0.5), np.bool_(True), np.float32(2.5), np.array([0.25]), [np.str_("cup")])
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        store.append(given)
        store.append(transition(2))
        assert store.load() == [Transition(1, 2, 3, 4, 0.5, True, 2.5, (0.25,), ("cup",)), transition(2)]


@pytest.mark.parametrize(
    "change",
    [{"s": -1}, {"a": 0.5}, {"s_next": "4"}, {"reward": np.nan}, {"duration": np.inf}, {"reward": None}, {"q": ("x",)}, {"touched": None}],
)
def test_what_could_not_be_read_again_is_refused(tmp_path, change):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        with pytest.raises(InvalidValue, match="transition 1 cannot be stored"):
            store.append(replace(transition(1), **change))
        store.append(transition(1))
        assert store.load() == [transition(1)]


def test_agents_in_one_file_have_their_own_numbers(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as torso, TransitionStore(tmp_path / "run.sqlite", "left_arm") as arm:
        torso.append(transition(1))
        torso.append(transition(2))
        arm.append(transition(1))
        assert len(torso.load()) == 2 and len(arm.load()) == 1
        assert arm.load("torso") == torso.load()
        assert arm.agents() == ("left_arm", "torso")


def test_a_kill_at_any_time_leaves_all_that_was_reported_without_a_gap(tmp_path):
    path = tmp_path / "run.sqlite"
    rng = np.random.default_rng(0)
    for _ in range(5):
        child = appender(path, "torso")
        reported = int(child.stdout.readline())
        time.sleep(rng.uniform(0.0, 0.15))
        child.send_signal(signal.SIGKILL)
        rest, _ = child.communicate()
        whole_lines = rest.split("\n")[:-1]
        reported = int(whole_lines[-1]) if whole_lines else reported
        with TransitionStore(path, "torso") as store:
            loaded = store.load()
        assert reported <= len(loaded) <= reported + 1
        assert loaded == [transition(n) for n in range(1, len(loaded) + 1)]
    assert len(loaded) > 10


def test_settings_are_kept_and_only_the_same_are_taken(tmp_path):
    path = tmp_path / "run.sqlite"
    settings = {"seed": 3, "space": {"levels": [0.25, 0.75]}}
    with TransitionStore(path, "torso") as store:
        assert store.settings() == {}
        store.bind(settings)
    with TransitionStore(path, "torso") as store:
        store.bind(settings)
        assert store.settings() == settings
        for other in ({**settings, "seed": 4}, {"seed": 3}):
            with pytest.raises(MobeeError, match="torso has .* on record.*or another file"):
                store.bind(other)
        assert store.settings() == settings
    with TransitionStore(path, "left_arm") as store:
        store.bind({"seed": 4})


def test_the_differing_entries_of_nested_settings_are_reported(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        store.bind({"plant": {"dt": 0.02, "gains": {"damping": 50.0, "stiffness": 50.0}}})
        with pytest.raises(MobeeError) as error:
            store.bind({"plant": {"dt": 0.02, "gains": {"damping": 50.0, "stiffness": 40.0}}})
        assert 'plant = {"gains": {"stiffness": 50.0}} on record, now {"gains": {"stiffness": 40.0}}.' in str(error.value)
        with pytest.raises(MobeeError, match="now null"):
            store.bind({})


def test_a_record_with_fewer_settings_is_refused_with_its_possible_uses(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        store.bind({"seed": 1})
        with pytest.raises(
            MobeeError, match=r"run\.sqlite: torso has no beliefs, goal on record.*earlier version.*mobee export.*another file"
        ):
            store.bind({"seed": 1, "goal": None, "beliefs": "counts"})
        assert store.settings() == {"seed": 1}


def test_when_each_was_committed_is_on_record(tmp_path):
    begin = time.time()
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        for n in (1, 2, 3):
            store.append(transition(n))
        times = store.times()
    assert len(times) == 3 and begin <= times[0] <= times[1] <= times[2] <= time.time()


def test_an_empty_name_is_a_valid_agent_without_data(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        store.bind({"seed": 1})
        store.append(transition(1))
        assert store.load("") == store.times("") == [] and store.settings("") == {}
        assert len(store.load()) == len(store.times()) == len(store.settings()) == 1


def test_a_number_out_of_order_is_refused(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        store.append(transition(1))
        for n in (1, 3):
            with pytest.raises(MobeeError, match=f"has 1 transitions: append number 2, not {n}"):
                store.append(transition(n))
        assert len(store.load()) == 1


def one_line(error: pytest.ExceptionInfo[MobeeError]) -> str:
    message = str(error.value)
    assert "\n" not in message and "run.sqlite: " in message
    return message


def test_two_processes_with_one_agent_name_are_reported(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as first, TransitionStore(tmp_path / "run.sqlite", "torso") as second:
        first.append(transition(1))
        with pytest.raises(MobeeError) as error:
            second.append(transition(1))
        assert "another process writes transitions of the same agent" in one_line(error)


def test_an_edited_file_with_a_gap_is_refused(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, "torso") as store:
        for n in (1, 2, 3):
            store.append(transition(n))
    with sqlite3.connect(path) as db:
        db.execute("DELETE FROM transitions WHERE n = 2")
    db.close()
    with TransitionStore(path, "torso") as store, pytest.raises(MobeeError) as error:
        store.load()
    assert "transition 2 of torso is missing" in one_line(error)
