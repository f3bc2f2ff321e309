# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mobee
import mobee.model.world
from experiments.claims.ch2_model import model_throughput
from experiments.claims.ch2_model.model_throughput import Flood, binned, flood_model, rates
from experiments.claims.ch2_model.model_throughput_endurance import (
    Editor,
    Reference,
    WatchedWorld,
    endure,
    other_objects,
    out_of_order,
    slope_mb_per_minute,
    torn_table,
    witnesses,
)
from experiments.claims.ch2_model.model_throughput_threads import Oscillator
from experiments.kit.run_folder import read_records
from mobee.model.engine import changed
from tests.experiments.options import options_of


def run(folder, *options):
    return model_throughput.EXPERIMENT.method.run(options_of(model_throughput.EXPERIMENT, "--edits", "5", *options), folder)


def test_each_replacement_removes_one_box_and_creates_another():
    world = mobee.World()
    made = Flood(world, "katana", seed=1)
    for _ in range(4):
        made.create_object()
    before, version = set(world.objects), world.version
    made.replace_objects(3)
    assert world.version == version + 6
    assert sorted(made.names) == sorted(world.objects)
    assert len(world.objects) == 4
    assert 1 <= len(before - set(world.objects)) <= 3


def test_every_motor_goes_through_its_whole_range(rng):
    robot = mobee.load_robot("icub")
    oscillator = Oscillator(robot, rng)
    path = np.array([oscillator.at(t) for t in np.arange(0.0, 20.0, 0.01)])
    low, high = robot.limits.T
    np.testing.assert_array_less(low - 1e-12, path.min(axis=0))
    np.testing.assert_array_less(path.max(axis=0), high + 1e-12)
    assert (np.ptp(path, axis=0) > 0.99 * (high - low)).all()


def test_a_flood_records_every_number_of_objects():
    records = list(flood_model("katana", first=1, last=3, edits=5, seed=0, is_over=lambda: False))
    assert [(r["objects"], r["edits"]) for r in records] == [(0, 0), (1, 10), (1, 0), (2, 10), (2, 0), (3, 10)]
    assert all(r["seconds"] > 0 for r in records)
    assert all(r["evaluations"] > 0 for r in records if not r["edits"])


def test_an_exception_in_the_models_thread_is_raised(monkeypatch):
    def evaluate(self, q):
        raise mobee.InvalidValue("made to fail")

    monkeypatch.setattr(mobee.Model, "evaluate", evaluate)
    with pytest.raises(mobee.InvalidValue, match="made to fail"):
        list(flood_model("katana", first=1, last=3, edits=5, seed=0, is_over=lambda: False))


def test_rates_weigh_records_by_their_time():
    def record(objects, seconds, evaluations):
        return {"robot": "icub", "objects": objects, "edits": 10, "seconds": seconds, "evaluations": evaluations}

    records = [record(100, 1.0, 100), record(105, 3.0, 100), record(200, 1.0, 7), record(3, 1.0, 9)]
    assert dict(rates(records)) == {100: 50, 200: 7}
    assert list(binned(records, 2.0)) == [(51.5, 54.5), (105.0, pytest.approx(100 / 3))]


def short(objects, evaluations, seconds=0.01):
    return {"robot": "icub", "objects": objects, "edits": 200, "seconds": seconds, "evaluations": evaluations}


def test_records_too_short_for_a_rate_are_pooled_with_the_nearest():
    records = [short(number, 0 if number % 2 else 20) for number in range(1, 61)]
    found = dict(rates(records))
    assert 1 not in found and set(found.values()) <= {900, 950, 1000, 1050, 1100}
    assert 50 in found


def test_a_flood_too_short_in_all_has_no_rate():
    records = [short(number, 20) for number in range(1, 6)]
    assert not dict(rates(records))
    assert not list(binned(records, 1.0))


def test_four_threads_edit_for_some_seconds_and_nothing_is_torn(tmp_path):
    verdict = endure(tmp_path, threads=4, duration=3.0, seed=0)
    assert verdict["torn"] == {}
    assert verdict["exceptions"] == {}
    assert verdict["passed"]
    assert verdict["evaluations"] > 10
    assert verdict["edits"] > 100
    assert len(read_records(tmp_path / "endurance.csv", ("seconds", "evaluations", "torn"))) >= 3


def test_a_world_whose_rows_lag_behind_its_objects_does_not_pass(tmp_path, monkeypatch):
    monkeypatch.setattr(mobee.model.world, "changed", lambda old, new: replace(changed(old, new), rows=old.rows))
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
    made.world.follow(made.evaluate(made.robot.home))
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
        editor._step_witnesses()
        assert out_of_order(world.objects, 1) is None
    first, second = witnesses(0)
    world.move(second, position=(0.011, 0.0, 5.0))
    assert "thread 0" in out_of_order(world.objects, 1)


def test_a_leak_has_a_slope_and_a_first_rise_has_none():
    seconds = np.arange(0.0, 100.0)
    assert slope_mb_per_minute(seconds, 50.0 + seconds / 60.0) == pytest.approx(1.0)
    assert slope_mb_per_minute(seconds, np.where(seconds < 15.0, 50.0 + seconds, 65.0)) == pytest.approx(0.0, abs=1e-9)
    assert slope_mb_per_minute(seconds[:50], seconds[:50]) is None


def test_a_flood_shorter_than_a_bin_is_one_point():
    assert list(binned([short(number, 10) for number in range(1, 62)], 1.0)) == [(31.0, pytest.approx(1000.0))]


def test_of_an_endurance_run_its_course_is_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    endure(tmp_path, threads=1, duration=0.2, seed=0)
    assert model_throughput.EXPERIMENT.method.figure(tmp_path).read_bytes().startswith(b"\x89PNG")
