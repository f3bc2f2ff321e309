# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mobee
from mobee.roadmap.building import build, checkpoint, search_scheduler
from mobee.roadmap.building.checkpoint import Progress

MOTORS = ["torso", "r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow", "r_wrist_prosup", "r_wrist_pitch", "r_wrist_yaw"]
COSTS = [mobee.costs.orientation("right_palm", [0.0, 0.0, -1.0], tolerance=0.2), mobee.costs.plane("right_palm", [0, 0, 1], 0.0, 0.02)]
TASK = mobee.tasks.place("right_palm", "xy", [(-0.4, -0.25), (0.1, 0.3)])
QUICK = mobee.SearchSettings(std=0.02, searches=8)


@pytest.fixture(scope="module")
def model(icub: mobee.Robot) -> mobee.Model:
    return mobee.Model(icub, mobee.load_world("table"))


def _build(model: mobee.Model, **others: Any) -> mobee.Roadmap:
    names = [one.name for one in dataclasses.fields(mobee.RoadmapSettings)]
    settings = {"method": "nes", "search": QUICK} | {name: others.pop(name) for name in names if name in others}
    arguments = {"costs": COSTS, "task": TASK, "spacing": 0.05, "motors": MOTORS} | others
    return mobee.build_roadmap(model, **arguments, settings=mobee.RoadmapSettings(**settings))


@pytest.fixture(scope="module")
def whole(model: mobee.Model) -> mobee.Roadmap:
    return _build(model)


RAIL = """<robot name="rail"><link name="base"/>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-2" upper="2" velocity="1" effort="9"/></joint><link name="cart"/>
<joint name="turn" type="revolute"><parent link="cart"/><child link="tip"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="9"/></joint><link name="tip"/></robot>"""


class Cut(Exception):
    """Interrupts a building."""


def _cut_after(vertices: int) -> Callable[[Progress], None]:
    def report(progress: Progress) -> None:
        if progress.vertices >= vertices:
            raise Cut

    return report


@pytest.mark.parametrize("method", ["nes", "hybrid", "least_squares"])
def test_every_pose_is_good_by_the_reference_engine_and_apart_from_the_others(
    method: str, model: mobee.Model, whole: mobee.Roadmap
) -> None:
    trm = whole if method == "nes" else _build(model, method=method)
    pose = mobee.Model(model.robot, model.world, engine="fcl").evaluate(trm.q)
    assert len(trm.q) >= 8
    assert not np.asarray(pose.count).any()
    for term in COSTS:
        assert (term.residual(pose) <= term.tolerance + 1e-9).all()
    y = TASK.of(pose)
    assert np.allclose(y, trm.y, atol=1e-9)
    assert ((y >= TASK.box[:, 0] - 1e-9) & (y <= TASK.box[:, 1] + 1e-9)).all()
    limits = model.robot.limits
    assert ((trm.q >= limits[:, 0]) & (trm.q <= limits[:, 1])).all()
    apart = np.linalg.norm((y[:, None] - y) / trm.spacing, axis=-1)
    assert apart[np.triu_indices(len(y), 1)].min() >= 0.8
    assert np.abs(trm.q[trm.edges[:, 0]] - trm.q[trm.edges[:, 1]]).max() <= 0.4


def test_motors_that_may_not_move_stay_at_the_start(model: mobee.Model) -> None:
    start = model.robot.home.copy()
    start[model.robot.motor_index("l_elbow")] = 1.0
    trm = _build(model, start=start)
    still = [k for k, name in enumerate(model.robot.motors) if name not in trm.settings["motors"]]
    assert len(still) == len(model.robot.motors) - 10
    assert np.array_equal(trm.q[:, still], np.repeat(start[None, still], len(trm.q), axis=0))


@pytest.mark.parametrize("method", ["nes", "least_squares"])
def test_motors_keep_the_margin_from_their_limits(method: str, model: mobee.Model) -> None:
    margin = 0.2
    trm = _build(model, method=method, margin=margin)
    free = [model.robot.motor_index(name) for name in trm.motors]
    low, high = model.robot.limits[free].T
    kept = np.minimum(margin, 0.25 * (high - low)) - 1e-9
    assert len(trm.q) >= 4
    assert (trm.q[:, free] >= low + kept).all() and (trm.q[:, free] <= high - kept).all()
    with pytest.raises(mobee.InvalidValue, match="margin"):
        _build(model, margin=-0.1)


def test_a_slide_has_metres_and_the_margin_of_the_control_law(tmp_path: Path) -> None:
    (tmp_path / "rail.urdf").write_text(RAIL)
    robot = mobee.load_robot(tmp_path / "rail.urdf")
    task = mobee.tasks.motors({"slide": (-2.0, 2.0), "turn": (-1.0, 1.0)})
    settings = mobee.RoadmapSettings(method="least_squares", margin=np.deg2rad(10.0))
    trm = mobee.build_roadmap(mobee.Model(robot), [mobee.costs.home()], task, (0.1, 0.5), settings=settings)
    assert trm.settings["units"] == ["m", "rad"]
    zone = 4.0 * 10.0 / 200.0  # m, the limit zone of the default gains
    assert 1.7 < np.abs(trm.q[:, 0]).max() <= 2.0 - zone


def test_the_same_seed_gives_the_same_map_for_any_number_of_threads(
    model: mobee.Model, whole: mobee.Roadmap, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "MAX_THREADS", 1)
    again = _build(model)
    assert np.array_equal(again.q, whole.q)
    assert np.array_equal(again.edges, whole.edges)


@pytest.mark.parametrize(("method", "vertices"), [("nes", 0), ("nes", 6), ("hybrid", 1), ("hybrid", 13), ("least_squares", 4)])
def test_an_interrupted_building_resumes_to_the_same_map(
    method: str, vertices: int, model: mobee.Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpoint, "SAVE_PERIOD", 0.0)
    monkeypatch.setattr(checkpoint, "PROGRESS_PERIOD", 0.0)
    file = tmp_path / "map.npz"
    whole = _build(model, method=method)
    with pytest.raises(Cut):
        _build(model, method=method, file=file, progress=_cut_after(vertices))
    part = mobee.load_roadmap(file, model)
    assert part.settings["finished"] is False
    assert vertices <= len(part.q) <= len(whole.q)
    rest = _build(model, method=method, file=file)
    assert np.array_equal(rest.q, whole.q)
    assert rest.settings["evaluations"] == whole.settings["evaluations"]


def test_a_finished_map_is_not_built_again(model: mobee.Model, whole: mobee.Roadmap, tmp_path: Path) -> None:
    file = tmp_path / "map.npz"
    _build(model, file=file)
    again = _build(model, file=file, progress=_cut_after(0))
    assert np.array_equal(again.q, whole.q)
    assert again.settings["finished"] is True


@pytest.mark.parametrize("seed", [-1, 1.5, True])
def test_a_seed_that_is_no_whole_number_of_at_least_0_is_refused(seed: Any, model: mobee.Model, tmp_path: Path) -> None:
    with pytest.raises(mobee.InvalidValue, match="must be a whole number, 0 or more"):
        _build(model, seed=seed, file=tmp_path / "map.npz")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("others", "name"),
    [
        ({"spacing": 0.06}, "spacing"),
        ({"seed": 1}, "seed"),
        ({"costs": [*COSTS[:1], mobee.costs.plane("right_palm", [0, 0, 1], 0.01, 0.02)]}, "meaning"),
        ({"search": dataclasses.replace(QUICK, delta=1.0)}, "front"),
    ],
)
def test_a_file_of_other_settings_is_refused_with_both_digests(
    others: dict[str, object], name: str, model: mobee.Model, tmp_path: Path
) -> None:
    file = tmp_path / "map.npz"
    _build(model, file=file)
    with pytest.raises(mobee.MobeeError) as refused:
        _build(model, file=file, **others)
    digests = re.findall(r"\b[0-9a-f]{16}\b", str(refused.value))
    assert len(set(digests)) == 2
    assert f"differ in {name}" in str(refused.value)


def test_a_file_of_another_world_is_refused_with_the_digests_of_both(model: mobee.Model, tmp_path: Path) -> None:
    file = tmp_path / "map.npz"
    trm = _build(model, file=file)
    other = mobee.Model(model.robot, mobee.load_world("table"))
    other.world.add("cup", mobee.sphere(0.03), position=(-0.3, 0.5, 0.0))
    with pytest.raises(mobee.MobeeError, match=rf"world_digest {trm.settings['world_digest']}, now [0-9a-f]{{16}}"):
        _build(other, file=file)


def test_a_world_that_changed_meanwhile_is_an_error(icub: mobee.Robot) -> None:
    model = mobee.Model(icub, mobee.load_world("table"))

    def report(progress: Progress) -> None:
        if "cup" not in model.world.objects:
            model.world.add("cup", mobee.sphere(0.03), position=(0.5, 0.5, 0.0))

    with pytest.raises(mobee.MobeeError, match="has changed while the map was built"):
        _build(model, progress=report)


def test_settings_are_plain_json(whole: mobee.Roadmap) -> None:
    settings = json.loads(json.dumps(whole.settings))
    assert settings["names"] == list(TASK.names)
    assert settings["units"] == ["m", "m"]
    assert settings["costs"][-1] == "collision"
    assert (settings["seed"], settings["method"], settings["finished"]) == (0, "nes", True)
    assert settings["evaluations"] > len(whole.q)
    assert settings["versions"].keys() == {"mobee", "numpy"}


def test_numbers_of_numpy_are_settings(model: mobee.Model, tmp_path: Path) -> None:
    search = dataclasses.replace(QUICK, patience=np.float32(3.0), searches=np.int32(4))
    numbers = {"seed": np.int64(0), "neighbours": np.int64(4), "longest": np.float32(0.5), "search": search}
    found = _build(model, file=tmp_path / "map.npz", **numbers)
    same = _build(model, neighbours=4, longest=0.5, search=dataclasses.replace(QUICK, patience=3.0, searches=4))
    np.testing.assert_array_equal(mobee.load_roadmap(tmp_path / "map.npz").edges, same.edges)
    assert json.dumps(found.settings["front"]) == json.dumps(same.settings["front"])


def test_neighbours_and_longest_choose_the_edges(model: mobee.Model, whole: mobee.Roadmap) -> None:
    every = _build(model, longest=None)
    assert len(every.edges) == 2 * len(every.q) - 3
    assert {tuple(edge) for edge in whole.edges} <= {tuple(edge) for edge in every.edges}
    many = _build(model, longest=None, neighbours=4)
    joined = np.bincount(many.edges.ravel(), minlength=len(many.q))
    assert joined.min() >= 4
    assert np.array_equal(many.q, whole.q)


def test_plain_functions_are_costs_and_coordinates(model: mobee.Model) -> None:
    def low_elbow(pose: mobee.Pose, contacts: object) -> np.ndarray:
        return np.maximum(0.0, pose.position("right_elbow")[..., 2])

    along = mobee.tasks.function(lambda pose: pose.position("right_palm")[..., 0], -0.4, -0.2, "forward", "m")
    trm = _build(model, costs=[*COSTS, low_elbow], task=along, method="hybrid", spacing=0.04)
    assert len(trm.q) >= 3
    assert (model.evaluate(trm.q).position("right_elbow")[:, 2] <= 0.005 + 1e-9).all()


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ({"spacing": float("nan")}, "finite and above 0"),
        ({"spacing": 0.0}, "finite and above 0"),
        ({"spacing": [0.1, 0.1, 0.1]}, "one number, or 2"),
        ({"method": "ness"}, "Did you mean 'nes'"),
        ({"neighbours": 0}, "at least 1"),
        ({"neighbours": 2.5}, "whole number"),
        ({"neighbours": True}, "whole number"),
        ({"longest": 0.0}, "above 0"),
        ({"longest": float("inf")}, "finite number above 0.*None for no limit"),
        ({"longest": "0.4"}, "finite number above 0"),
        ({"costs": COSTS[0]}, "of type Term; give a list of terms"),
        ({"costs": (one for one in COSTS)}, r"of type generator; give a list of terms, as list\(costs\)"),
        ({"motors": ["right_harm"]}, "right_arm"),
        ({"start": [0.0]}, "a position for every motor"),
    ],
)
def test_arguments_that_are_not_valid_are_refused(others: dict[str, object], message: str, model: mobee.Model) -> None:
    with pytest.raises(mobee.MobeeError, match=message):
        _build(model, **others)


def test_a_task_out_of_reach_is_an_error(model: mobee.Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search_scheduler, "MAX_FIRST_SEARCHES", 2)
    monkeypatch.setattr(search_scheduler, "FIRST_PATIENCE", 1)
    far = mobee.tasks.place("right_palm", "xy", [(2.0, 2.1), (0.0, 0.1)])
    with pytest.raises(mobee.MobeeError, match=r"no pose was found .* right_palm x is .*, outside 2 \.\. 2\.1"):
        _build(model, task=far, search=QUICK)


@pytest.mark.parametrize(
    "wrong",
    [
        {"delta": 0.0},
        {"delta": 1.5},
        {"std": 0.0},
        {"wide_std": 2.0},
        {"population": 3},
        {"population": 8.5},
        {"patience": 0},
        {"patience": float("inf")},
        {"patience": float("nan")},
        {"tries": 0},
        {"searches": 2.5},
        {"searches": "4"},
    ],
)
def test_search_settings_out_of_range_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(mobee.InvalidValue, match=next(iter(wrong))):
        mobee.SearchSettings(**wrong)
