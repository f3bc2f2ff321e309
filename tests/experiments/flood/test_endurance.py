from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mobee
import mobee.collision.world
from experiments.flood.editor import Editor, out_of_order, witnesses
from experiments.flood.endurance import endure
from experiments.flood.memory import slope_mb_per_minute
from experiments.flood.tearing import Reference, WatchedWorld, other_objects, torn_table
from experiments.kit.records import read_records
from mobee.collision.snapshot import changed


def test_four_threads_edit_for_some_seconds_and_nothing_is_torn(tmp_path):
    verdict = endure(tmp_path, threads=4, duration=3.0, seed=0)
    assert verdict["torn"] == {}
    assert verdict["exceptions"] == {}
    assert verdict["passed"]
    assert verdict["evaluations"] > 10
    assert verdict["edits"] > 100
    assert len(read_records(tmp_path / "endurance.csv", ("seconds", "evaluations", "torn"))) >= 3


def test_a_world_whose_rows_lag_behind_its_objects_does_not_pass(tmp_path, monkeypatch):
    monkeypatch.setattr(mobee.collision.world, "changed", lambda old, new: replace(changed(old, new), rows=old.rows))
    verdict = endure(tmp_path, threads=2, duration=0.5, seed=0)
    assert not verdict["passed"]
    assert "rows are not those of the objects" in verdict["torn"]


def test_an_edit_that_raises_does_not_pass(tmp_path, monkeypatch):
    def role(self):
        raise RuntimeError("made to fail")

    monkeypatch.setattr(Editor, "_role", role)
    verdict = endure(tmp_path, threads=1, duration=0.5, seed=0)
    assert not verdict["passed"]
    assert any("made to fail" in text for text in verdict["exceptions"])


@pytest.fixture
def model():
    made = mobee.Model(mobee.load_robot("katana"), WatchedWorld())
    made.evaluate(made.robot.home)
    made.world.add("a", mobee.box(0.1, 0.2, 0.3), position=(0.1, 0.0, 0.2))
    made.world.add("b", mobee.box(0.3, 0.3, 0.3), position=(0.0, 0.0, 0.3), role="target")
    made.world.add("c", mobee.box(0.1, 0.1, 0.1), position=(0.0, 0.3, 0.0), role="ghost")
    made.world.attach("a", made.robot.links[-1])
    return made


def test_a_sound_evaluation_is_not_complained_of(model):
    pose = model.evaluate(model.robot.home)
    assert pose.contacts
    assert torn_table(model.world.seen) is None
    assert other_objects(pose, model.world.seen) is None
    assert Reference(model.robot).other_contacts(pose, model.world.seen) is None


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda s: {"names": s.names[::-1]}, "names"),
        (lambda s: {"names": s.names[:-1]}, "names"),
        (lambda s: {"roles": s.roles[::-1]}, "roles"),
        (lambda s: {"roles": s.roles[:-1]}, "roles"),
        (lambda s: {"attached": ()}, "attached"),
        (lambda s: {"rows": s.rows[:-1]}, "rows"),
        (lambda s: {"rows": (s.rows.view(np.int64) ^ np.eye(1, s.rows.nbytes // 8, dtype=np.int64)[0]).view(s.rows.dtype)}, "rows"),
    ],
)
def test_every_part_of_a_torn_snapshot_is_found(model, change, complaint):
    snapshot = model.world.snapshot
    assert torn_table(replace(snapshot, **change(snapshot))).startswith(complaint)


def test_an_evaluation_of_another_world_is_found(model):
    pose, before = model.evaluate(model.robot.home), model.world.seen
    model.world.move("b", position=(0.0, 0.0, 0.9))
    assert "another 'b'" in other_objects(pose, model.world.snapshot)
    assert "contacts" in Reference(model.robot).other_contacts(pose, model.world.snapshot)
    model.world.remove("b")
    assert "other names" in other_objects(pose, model.world.snapshot)
    assert other_objects(pose, before) is None


def test_edits_seen_in_another_order_than_they_were_made_are_found():
    world = mobee.World()
    robot = mobee.load_robot("katana")
    editor = Editor(world, robot, "katana", 0, 0)
    for _ in range(1010):
        editor._walk()
        assert out_of_order(world.objects, 1) is None
    first, second = witnesses(0)
    world.move(second, position=(0.011, 0.0, 5.0))
    assert "thread 0" in out_of_order(world.objects, 1)


def test_a_leak_has_a_slope_and_a_first_rise_has_none():
    seconds = np.arange(0.0, 100.0)
    assert slope_mb_per_minute(seconds, 50.0 + seconds / 60.0) == pytest.approx(1.0)
    assert slope_mb_per_minute(seconds, np.where(seconds < 15.0, 50.0 + seconds, 65.0)) == pytest.approx(0.0, abs=1e-9)
    assert slope_mb_per_minute(seconds[:50], seconds[:50]) is None
