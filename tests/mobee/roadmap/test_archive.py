# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import tracemalloc
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mobee
from mobee.roadmap.archive import read, robot_digest, world_as_json, world_digest, world_from_json, write


def test_a_robot_read_again_under_another_name_is_the_same(icub: mobee.Robot) -> None:
    assert robot_digest(
        replace(mobee.load_robot("icub"), name="other", links=tuple(f"l{k}" for k in range(len(icub.links))))
    ) == robot_digest(icub)


@pytest.mark.parametrize("what", ["limits", "marker", "shape", "pairs"])
def test_a_robot_with_another_body_is_another(icub: mobee.Robot, what: str) -> None:
    first, palm = icub.motor_table[0], icub.markers["left_palm"]
    other = {
        "limits": {"motor_table": (replace(first, limits=first.limits * 0.999), *icub.motor_table[1:])},
        "marker": {"markers": icub.markers | {"left_palm": replace(palm, position=palm.position + 1e-6)}},
        "shape": {"shapes": (replace(icub.shapes[0], size=tuple(1.001 * x for x in icub.shapes[0].size)), *icub.shapes[1:])},
        "pairs": {"solid_pairs": icub.solid_pairs[1:]},
    }[what]
    assert robot_digest(replace(icub, **other)) != robot_digest(icub)


def test_the_digest_of_a_world_depends_only_on_objects_that_can_be_touched() -> None:
    def world(ball: float = 0.1, role: str = "target", names: tuple[str, str] = ("ball", "block"), ghost: bool = False) -> str:
        made = mobee.World()
        things = [(names[0], mobee.sphere(0.03), ball, role), (names[1], mobee.box(1, 1, 1), 1.0, "obstacle")]
        for name, shape, z, how in things if names[0] < names[1] else things[::-1]:
            made.add(name, shape, position=(0.0, 0.0, z), role=how)
        if ghost:
            made.add("ghost", mobee.sphere(0.5), role="ghost")
        return world_digest(made)

    assert world() == world(names=("z", "a")) == world(ghost=True) == world(ball=0.1 + 1e-13)
    assert len({world(), world(ball=0.2), world(role="obstacle"), world_digest(mobee.World())}) == 4
    assert len(world()) == 16


def test_attaching_an_object_changes_the_world_s_digest() -> None:
    free, carried = mobee.World(), mobee.World()
    for world in (free, carried):
        world.add("cup", mobee.sphere(0.03))
    carried.attach("cup", "l_hand", (np.zeros(3), np.eye(3)))
    assert world_digest(free) != world_digest(carried)


def test_a_map_that_is_written_anew_keeps_its_mode_and_the_links_to_it(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    target, link = tmp_path / "maps" / "map.npz", tmp_path / "map.npz"
    target.touch(0o600)
    link.symlink_to(target)
    write(link, {"q": np.zeros(3)}, {})
    assert link.is_symlink() and target.stat().st_mode & 0o777 == 0o600
    assert read(target)[0]["q"].tolist() == [0.0] * 3


def test_mass_and_friction_of_objects_are_kept_and_may_be_absent() -> None:
    world = mobee.World()
    world.add("cup", mobee.cylinder(0.03, 0.1), position=(0.1, 0.2, 0.3), role="target", color=(1.0, 0.0, 0.0), mass=0.2, friction=0.8)
    world.add("ball", mobee.sphere(0.05), mass=0.1)
    world.add("ice", mobee.box(0.1, 0.1, 0.1), friction=0.0)
    world.add("table", mobee.box(1.0, 1.0, 0.1))
    world.attach("ball", "l_hand", (np.full(3, 0.1), np.eye(3)))
    stored = json.loads(json.dumps(world_as_json(world)))
    assert [sorted({"mass", "friction"} & one.keys()) for one in stored] == [["friction", "mass"], ["mass"], ["friction"], []]
    again = world_from_json(stored)
    for name, one in world.objects.items():
        other = again.objects[name]
        assert (other.mass, other.friction, other.color, other.link) == (one.mass, one.friction, one.color, one.link)
        assert (other.kind, other.size, other.role) == (one.kind, one.size, one.role)
        assert np.array_equal(other.position, one.position) and np.array_equal(other.rotation, one.rotation)
    earlier = world_from_json([{key: one[key] for key in one if key not in ("mass", "friction")} for one in stored])
    assert {(one.mass, one.friction) for one in earlier.objects.values()} == {(None, 0.5)}
    with pytest.raises(mobee.InvalidValue, match="mass 'heavy'"):
        world_from_json([stored[0] | {"mass": "heavy"}])


def _bomb(path: Path, header: bytes, content: bytes, notes: bytes = b"{}", compress: int = zipfile.ZIP_STORED) -> None:
    """An .npz whose array claims what its header says."""
    with zipfile.ZipFile(path, "w", compress) as archive:
        for name, data in (("notes", _npy(b"|u1", len(notes)) + notes), ("poses", header + content)):
            archive.writestr(f"{name}.npy", data)


def _npy(dtype: bytes, count: int) -> bytes:
    text = b"{'descr': '%s', 'fortran_order': False, 'shape': (%d,), }" % (dtype, count)
    text = text.ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize(
    "bomb",
    [
        lambda path: _bomb(path, _npy(b"<f8", 10**13), bytes(800)),
        lambda path: _bomb(path, _npy(b"<f8", 10**7), bytes(8 * 10**7), compress=zipfile.ZIP_DEFLATED),
        lambda path: _bomb(path, _npy(b"<f8", 1), bytes(8), notes=b"[" * 200_000),
        lambda path: _bomb(path, _npy(b"|O", 1), bytes(8)),
        lambda path: _bomb(path, b"", b""),
    ],
    ids=["claims 80 TB", "80 MB in 80 kB", "nested notes", "objects", "empty"],
)
def test_a_file_that_claims_more_than_it_holds_is_one_line_and_takes_no_memory(tmp_path: Path, bomb: Callable[[Path], None]) -> None:
    bomb(tmp_path / "map.npz")
    tracemalloc.start()
    try:
        with pytest.raises(mobee.MobeeError, match="no roadmap, or only a part of one") as error:
            read(tmp_path / "map.npz")
        assert tracemalloc.get_traced_memory()[1] < 40_000_000
    finally:
        tracemalloc.stop()
    assert "\n" not in str(error.value)
