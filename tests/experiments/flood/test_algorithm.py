from __future__ import annotations

import argparse
import csv

import numpy as np
import pytest

import mobee
from experiments import flood
from experiments.flood.algorithm import Flood, flood_model
from experiments.flood.rates import binned, rates
from experiments.flood.threads import Oscillator


def asked(**changes) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    flood.add_arguments(parser)
    return argparse.Namespace(**{**vars(parser.parse_args([])), "seed": 0, "objects": 3, "edits": 5, **changes})


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


def test_what_fails_in_the_models_thread_is_not_hidden(monkeypatch):
    def evaluate(self, q):
        raise mobee.InvalidValue("made to fail")

    monkeypatch.setattr(mobee.Model, "evaluate", evaluate)
    with pytest.raises(mobee.InvalidValue, match="made to fail"):
        list(flood_model("katana", first=1, last=3, edits=5, seed=0, is_over=lambda: False))


def test_a_run_that_was_interrupted_goes_on_behind_its_records(tmp_path):
    part = flood.run(asked(robots=["katana"], objects=2), tmp_path)
    assert part["complete"]
    assert part["katana"]["objects_reached"] == 2
    whole = flood.run(asked(objects=4), tmp_path)
    assert whole["complete"]
    with (tmp_path / "flood.csv").open() as file:
        flooded = [(row["robot"], int(row["objects"])) for row in csv.DictReader(file) if int(row["edits"])]
    assert flooded == [(robot, n) for robot in ("katana", "icub") for n in (1, 2, 3, 4)]


def test_a_run_out_of_time_says_that_it_is_not_complete(tmp_path):
    result = flood.run(asked(robots=["katana"], objects=1000, edits=1, duration=1e-6), tmp_path)
    assert not result["complete"]


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
    told = dict(rates(records))
    assert 1 not in told and set(told.values()) <= {900, 950, 1000, 1050, 1100}
    assert 50 in told


def test_a_flood_too_short_in_all_has_no_rate():
    records = [short(number, 20) for number in range(1, 6)]
    assert not dict(rates(records))
    assert not list(binned(records, 1.0))


def test_a_flood_shorter_than_a_bin_is_one_point():
    assert list(binned([short(number, 10) for number in range(1, 62)], 1.0)) == [(31.0, pytest.approx(1000.0))]
