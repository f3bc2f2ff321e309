# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.errors import RobotFileError
from mobee.robot.urdf.mesh import find_mesh
from mobee.robot.xml.node import Node


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """A mesh in a package, the URDF's folder beside the package's meshes."""
    path = tmp_path / "ws" / "toy_description" / "meshes" / "m.stl"
    path.parent.mkdir(parents=True)
    path.write_text("")
    (tmp_path / "ws" / "toy_description" / "urdf").mkdir()
    return path


def named(folder: Path, filename: str) -> Path:
    return find_mesh(Node(folder / "toy.urdf", 7, "mesh", {"filename": filename}))


def test_a_package_is_found_from_the_urdf_upwards(mesh: Path, tmp_path: Path) -> None:
    for scheme in ("package", "model"):
        assert named(mesh.parents[1] / "urdf", f"{scheme}://toy_description/meshes/m.stl") == mesh
    assert named(tmp_path / "ws", "package://toy_description/meshes/m.stl") == mesh
    assert named(mesh.parents[1], "package://meshes/m.stl") == mesh  # any folder beside the file is as good as a package


def test_a_package_is_found_on_the_ros_path(mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = tmp_path / "elsewhere"
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path / 'ws'}")
    assert named(elsewhere, "package://toy_description/meshes/m.stl") == mesh
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws" / "toy_description"))
    assert named(elsewhere, "package://toy_description/meshes/m.stl") == mesh
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    (tmp_path / "install").mkdir()
    (tmp_path / "ws").rename(tmp_path / "install" / "share")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    installed = tmp_path / "install" / "share" / "toy_description" / "meshes" / "m.stl"
    assert named(elsewhere, "package://toy_description/meshes/m.stl") == installed


def test_paths_may_be_relative_absolute_or_addresses(mesh: Path) -> None:
    folder = mesh.parents[1] / "urdf"
    assert named(folder, "../meshes/m.stl").resolve() == mesh
    assert named(folder, str(mesh)) == mesh
    assert named(folder, f"file://{mesh}") == mesh


@pytest.mark.parametrize(
    ("filename", "message"),
    [
        ("package://toy/m.stl", r"toy.urdf:7: <mesh> filename: no mesh 'package://toy/m.stl' \(looked at .*\). Put the package's folder"),
        ("m.stl", r"no mesh 'm.stl' \(looked at .*m.stl\). Give a path that starts at the URDF's folder"),
        ("file:///nowhere/m.stl", r"no mesh 'file:///nowhere/m.stl' \(looked at /nowhere/m.stl\)"),
        ("http://host/m.stl", "'http://host/m.stl' cannot be followed. Write package://, file:// or a path"),
        ("http://[/m.stl", "cannot be followed"),
        ("a" * 5000, "no mesh"),
        ("m\0.stl", "holds a zero byte"),
        ("..", "no mesh"),
    ],
)
def test_a_missing_mesh_is_named_with_the_searched_places(tmp_path: Path, filename: str, message: str) -> None:
    with pytest.raises(RobotFileError, match=message):
        named(tmp_path, filename)
