# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import resource
import signal
import sqlite3

import numpy as np
import pytest

from mobee.errors import MobeeError, NoRoom
from mobee.store import TransitionStore
from tests.mobee.test_store import appender, one_line, transition


def test_commits_are_synchronous_and_ahead_of_the_file(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", "torso") as store:
        assert store._db.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        assert store._db.execute("PRAGMA synchronous").fetchone() == (2,)


def test_several_processes_start_and_append_at_once(tmp_path):
    path = tmp_path / "run.sqlite"
    children = [appender(path, agent, until=40) for agent in ("torso", "left_arm", "right_arm")]
    for child in children:
        _, errors = child.communicate(timeout=60)
        assert child.returncode == 0, errors
    with TransitionStore(path, "monitor") as store:
        for agent in store.agents():
            assert store.load(agent) == [transition(n) for n in range(1, 41)]
        assert len(store.agents()) == 3


def test_a_file_is_read_without_a_trace_also_while_it_is_written(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, "torso") as writer:
        writer.append(transition(1))
        with TransitionStore(path, "torso", read_only=True) as reader:
            assert reader.load() == [transition(1)]
            writer.append(transition(2))
            assert reader.load() == [transition(1), transition(2)]
            with pytest.raises(MobeeError, match="it may not be written"):
                reader.append(transition(2))
    content = path.read_bytes()
    with TransitionStore(path, "torso", read_only=True) as reader:
        assert len(reader.load()) == 2
        assert {entry.name for entry in tmp_path.iterdir()} == {"run.sqlite", "run.sqlite-lock"}
    assert path.read_bytes() == content


def test_an_empty_or_missing_file_cannot_be_read_and_stays_as_it_is(tmp_path):
    path = tmp_path / "run.sqlite"
    with pytest.raises(MobeeError, match="cannot be opened"):
        TransitionStore(path, "torso", read_only=True)
    assert not path.exists()
    path.touch()
    with pytest.raises(MobeeError, match="no transitions yet: it is empty"):
        TransitionStore(path, "torso", read_only=True)
    assert path.stat().st_size == 0


def set_version(path):
    TransitionStore(path, "torso").close()
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version = 99")
    db.close()


def other_program(path):
    with sqlite3.connect(path) as db:
        db.execute("CREATE TABLE recipes (name TEXT)")
    db.close()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (set_version, "written with schema 99, this mobee reads 1"),
        (other_program, "a database of another program"),
        (lambda path: path.write_text("<robot/>" * 200), "not a database; give another path"),
        (lambda path: path.mkdir(), "cannot be opened"),
    ],
    ids=["other schema", "other program", "no database", "folder"],
)
def test_a_file_that_is_not_a_store_of_this_schema_is_refused_and_left_as_it_was(tmp_path, make, message):
    path = tmp_path / "run.sqlite"
    make(path)
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(MobeeError) as error:
        TransitionStore(path, "torso")
    assert message in one_line(error)
    assert before is None or path.read_bytes() == before


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(MobeeError) as error:
        TransitionStore(tmp_path / "runs" / "run.sqlite", "torso")
    assert "check that its folder exists" in one_line(error)


def test_a_file_locked_by_another_process_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("mobee.database.BUSY_TIMEOUT", 0.2)
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, "torso") as store:
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(MobeeError) as error:
            store.append(transition(1))
        assert "another process kept it locked" in one_line(error)
        other.execute("ROLLBACK")
        other.close()
        store.append(transition(1))


def test_a_full_disk_is_named_and_costs_nothing_that_was_committed(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, "torso") as store:
        store._db.execute("PRAGMA max_page_count = 12")  # the database's own disk of 48 kB
        committed = 0
        with pytest.raises(MobeeError) as error:
            for n in range(1, 10_000):
                store.append(transition(n))
                committed = n
        assert "the disk is full; make room" in one_line(error)
        store._db.execute("PRAGMA max_page_count = 1000000")
        assert len(store.load()) == committed
        store.append(transition(committed + 1))


def test_a_write_that_the_system_refuses_is_named(tmp_path):
    path = tmp_path / "run.sqlite"

    def limit_file_size():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    child = appender(path, "torso", preexec_fn=limit_file_size)
    output, errors = child.communicate(timeout=60)
    assert child.returncode == 1
    assert "run.sqlite: the disk refused the write" in errors.strip().split("\n")[-1]
    with TransitionStore(path, "torso") as store:
        assert len(store.load()) >= int(output.split()[-1])


def stored(path, count=40):
    """A closed store with some transitions, and its bytes."""
    with TransitionStore(path, "torso") as store:
        store.bind({"seed": 1})
        for n in range(1, count + 1):
            store.append(transition(n))
    return path.read_bytes()


@pytest.mark.parametrize("seed", range(40))
def test_a_store_with_damaged_bytes_is_never_replaced_or_written(tmp_path, seed):
    """Flipped bytes in the content of a row are beyond SQLite's own checks, but a row is never lost without a word."""
    path = tmp_path / "run.sqlite"
    content = bytearray(stored(path))
    rng = np.random.default_rng(seed)
    begin = 0 if seed % 2 else 100  # half of them spare the header of the file
    for at in rng.integers(begin, len(content), 60):
        content[at] ^= int(rng.integers(1, 256))
    path.write_bytes(content)
    try:
        with TransitionStore(path, "torso") as store:
            assert len(store.load()) == 40
    except MobeeError as error:
        assert "\n" not in str(error) and str(path) in str(error)
        assert path.read_bytes() == bytes(content)


DAMAGE = [
    "UPDATE transitions SET q = 'no json' WHERE n = 3",
    "UPDATE transitions SET q = '{}' WHERE n = 3",
    "UPDATE transitions SET q = '[\"a\"]' WHERE n = 3",
    "UPDATE transitions SET q = hex(zeroblob(5)) WHERE n = 3",
    "UPDATE transitions SET s = 'two' WHERE n = 3",
    "UPDATE transitions SET s = -1 WHERE n = 3",
    "UPDATE transitions SET reward = 'high' WHERE n = 3",
    "UPDATE transitions SET touched = '[1]' WHERE n = 3",
    f"UPDATE transitions SET q = '{'[' * 100_000}' WHERE n = 3",
    "UPDATE meta SET value = '{'",
    "DROP TABLE meta",
    "ALTER TABLE transitions RENAME TO others; CREATE VIEW transitions AS SELECT * FROM others",
]


@pytest.mark.parametrize("statements", DAMAGE)
def test_content_that_mobee_did_not_write_is_one_line(tmp_path, statements):
    path = tmp_path / "run.sqlite"
    stored(path, 5)
    with sqlite3.connect(path) as db:
        for statement in statements.split(";"):
            db.execute(statement)
    db.close()
    with pytest.raises(MobeeError, match="it is damaged; nothing was written to it") as error:
        with TransitionStore(path, "torso") as store:
            store.settings()
            store.load()
    one_line(error)


def test_only_one_process_at_a_time_writes_the_data_of_an_agent(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, "torso") as store:
        store.append(transition(1))
        again = appender(path, "torso", until=3)
        _, errors = again.communicate(timeout=60)
        assert again.returncode == 1
        assert "run.sqlite: another process writes the data of torso" in errors.strip().split("\n")[-1]
        other = appender(path, "left_arm", until=3)
        assert other.wait(60) == 0
        with TransitionStore(path, "torso", read_only=True) as reader:
            assert len(reader.load()) == 1
        TransitionStore(path, "torso").close()  # this process still has the lock
    assert appender(path, "torso", until=3).wait(60) == 0


def test_a_lock_that_cannot_be_made_is_no_full_disk(tmp_path):
    (tmp_path / "run.sqlite-lock").mkdir()
    with pytest.raises(MobeeError) as error:
        TransitionStore(tmp_path / "run.sqlite", "torso")
    assert "run.sqlite-lock beside it cannot be made (Is a directory)" in one_line(error)
    assert not isinstance(error.value, NoRoom)
