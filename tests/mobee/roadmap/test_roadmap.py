# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue, MobeeError
from mobee.roadmap.archive import read, write
from mobee.roadmap.roadmap import Roadmap, load_roadmap

SIDE = 6  # vertices in each direction
SPACING = np.array([0.1, 0.2])


def table() -> mobee.Model:
    return mobee.Model(mobee.load_robot("icub"), mobee.load_world("table"))


def square(model: mobee.Model, cut: bool = False) -> Roadmap:
    """A lattice over two motors; `cut`: nothing leads over its middle."""
    rows, columns = (one.ravel() for one in np.meshgrid(range(SIDE), range(SIDE), indexing="ij"))
    y = np.stack([rows, columns], axis=1) * SPACING
    q = np.repeat(model.robot.home[None], SIDE**2, axis=0)
    q[:, [3, 4]] += 0.3 * y
    apart = np.abs(rows[:, None] - rows) + np.abs(columns[:, None] - columns)
    edges = np.argwhere(np.triu(apart == 1))
    if cut:
        edges = edges[(rows[edges[:, 0]] < 3) == (rows[edges[:, 1]] < 3)]
    settings = {"motors": [model.robot.motors[3], model.robot.motors[4]], "names": ["up", "side"]}
    return Roadmap(model, q, y, edges, SPACING, settings)


def test_a_path_leads_from_the_posture_over_the_map_to_the_goal() -> None:
    trm = square(table())
    start = trm.q[0] + 0.001
    path = trm.path(start, [0.5, 1.0])
    np.testing.assert_array_equal(path[0], start)
    np.testing.assert_array_equal(path[1], trm.q[0])
    np.testing.assert_array_equal(path[-1], trm.q[-1])
    assert len(path) == 1 + 2 * SIDE - 1
    assert {
        tuple(sorted(pair)) for pair in zip(trm.vertex_path(start, [0.5, 1.0]), trm.vertex_path(start, [0.5, 1.0])[1:], strict=False)
    } <= {tuple(edge) for edge in trm.edges.tolist()}


def test_a_path_from_a_vertex_begins_with_it_once() -> None:
    trm = square(table())
    assert len(trm.path(trm.q[7], trm.y[7])) == 1
    assert len(trm.path(trm.q[7], trm.y[8])) == 2


def test_motors_that_the_map_does_not_move_do_not_say_where_it_is_entered() -> None:
    trm = square(table())
    away = trm.q[9].copy()
    away[20] += 0.5
    assert trm.entry(away) == 9


def test_the_exit_is_the_nearest_in_spacings() -> None:
    trm = square(table())
    assert trm.exit([0.0, 0.09]) == 0  # 0.45 spacings off
    assert trm.exit([0.06, 0.09]) == SIDE
    assert trm.exit([-0.14, 0.0]) == 0


def test_a_goal_outside_of_the_map_is_refused_with_the_nearest_vertex() -> None:
    trm = square(table())
    with pytest.raises(InvalidValue, match=r"the map has no vertex near up -0.2, side 1: .* 2.0 spacings away, is at up 0, side 1;"):
        trm.path(trm.q[0], [-0.2, 1.0])
    with pytest.raises(InvalidValue, match=r"y_goal has shape \(3,\); it must be \(2,\) finite numbers: up, side"):
        trm.path(trm.q[0], [0.0, 0.0, 0.0])
    with pytest.raises(InvalidValue, match=r"q_from has shape \(2,\)"):
        trm.path([0.0, 0.0], [0.0, 0.0])


def test_unconnected_parts_are_reported() -> None:
    trm = square(table(), cut=True)
    with pytest.raises(MobeeError, match="the map has 2 unconnected parts, and the two vertices are in parts of 18 and 18 vertices"):
        trm.path(trm.q[0], trm.y[-1])


def test_an_empty_map_says_so() -> None:
    model = table()
    trm = Roadmap(model, np.empty((0, 41)), np.empty((0, 2)), np.empty((0, 2), dtype=np.intp), SPACING, {})
    with pytest.raises(InvalidValue, match="the map is empty"):
        trm.path(model.robot.home, [0.0, 0.0])


def test_arrays_that_do_not_belong_together_are_refused() -> None:
    trm = square(table())
    for q, edges in ((trm.q[:-1], trm.edges), (trm.q[:, 1:], trm.edges), (trm.q, trm.edges + 10), (trm.q, trm.edges[:, ::-1])):
        with pytest.raises(InvalidValue):
            Roadmap(trm.model, q, trm.y, edges, SPACING, {})


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"q": np.nan}, "q of vertex 7 has numbers that are not finite"),
        ({"y": np.inf}, "y of vertex 7 has numbers that are not finite"),
        ({"spacing": 0.0}, "spacing is .* above 0"),
        ({"spacing": np.nan}, "spacing is .* finite"),
    ],
)
def test_a_map_with_numbers_that_are_none_is_refused(changed: dict[str, float], text: str, tmp_path: Path) -> None:
    trm = square(table())
    arrays = {"q": trm.q.copy(), "y": trm.y.copy(), "edges": trm.edges, "spacing": trm.spacing.copy()}
    for name, value in changed.items():
        arrays[name].reshape(-1)[0 if name == "spacing" else 7 * arrays[name].shape[1]] = value
    with pytest.raises(InvalidValue, match=text):
        replace(trm, **arrays)
    trm.save(tmp_path / "map.npz")
    write(tmp_path / "map.npz", arrays, read(tmp_path / "map.npz")[1])
    with pytest.raises(MobeeError, match=f"damaged: {text}"):
        load_roadmap(tmp_path / "map.npz")


def test_a_map_read_back_is_the_map(tmp_path: Path) -> None:
    trm = square(table())
    trm.save(tmp_path / "map.npz")
    for found in (load_roadmap(tmp_path / "map.npz", table()), load_roadmap(tmp_path / "map.npz")):
        for name in ("q", "y", "edges", "spacing"):
            np.testing.assert_array_equal(getattr(found, name), getattr(trm, name))
        assert found.names == ("up", "side") and found.motors == trm.motors
        assert found.settings["robot"] == "icub"
    assert set(found.model.world.objects) == {"table", "ball"}
    assert [one.name for one in tmp_path.iterdir()] == ["map.npz"]


def test_a_map_of_another_robot_or_world_is_refused_with_both_digests(tmp_path: Path) -> None:
    square(table()).save(tmp_path / "map.npz")
    _, notes = read(tmp_path / "map.npz")
    moved = table()
    moved.world.move("ball", position=(-0.3, 0.1, -0.07))
    with pytest.raises(MobeeError, match=rf"made for world {notes['settings']['world_digest']}, and this world is [0-9a-f]{{16}}"):
        load_roadmap(tmp_path / "map.npz", moved)
    other = mobee.Model(mobee.load_robot("icub_2014"), mobee.load_world("table"))
    with pytest.raises(MobeeError, match=rf"made for robot {notes['settings']['robot_digest']}, and this robot is [0-9a-f]{{16}}"):
        load_roadmap(tmp_path / "map.npz", other)


def test_a_file_that_is_no_roadmap_is_refused_in_one_line(tmp_path: Path) -> None:
    square(table()).save(tmp_path / "map.npz")
    whole = (tmp_path / "map.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.npz").write_text("no map")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    np.save(tmp_path / "array.npy", np.zeros(3))
    write(tmp_path / "partial.npz", {"q": np.zeros((1, 41))}, {"settings": {}, "world": []})
    for name in ("cut.npz", "text.npz", "other.npz", "array.npy", "partial.npz"):
        with pytest.raises(MobeeError, match=name) as error:
            load_roadmap(tmp_path / name, table())
        assert "\n" not in str(error.value)
    with pytest.raises(MobeeError, match="no such file"):
        load_roadmap(tmp_path / "none.npz")


def test_a_map_of_a_later_format_is_refused(tmp_path: Path) -> None:
    text = json.dumps({"format": "mobee-roadmap 9"}).encode()
    np.savez(tmp_path / "later.npz", notes=np.frombuffer(text, dtype=np.uint8))
    with pytest.raises(MobeeError, match="mobee-roadmap 9"):
        load_roadmap(tmp_path / "later.npz")


def test_a_write_that_fails_leaves_the_old_map(tmp_path: Path) -> None:
    trm = square(table())
    trm.save(tmp_path / "map.npz")
    before = (tmp_path / "map.npz").read_bytes()
    trm.settings["broken"] = float("nan")
    with pytest.raises(ValueError):
        trm.save(tmp_path / "map.npz")
    assert (tmp_path / "map.npz").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1
    with pytest.raises(MobeeError, match="cannot be written"):
        square(table()).save(tmp_path / "no folder" / "map.npz")
