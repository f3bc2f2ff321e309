# SPDX-License-Identifier: Apache-2.0
"""What robot files draw: read from URDF, MJCF and zero-position XML, written, joined."""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import Simplified
from mobee.robot.join import join_robots
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot, Visual
from mobee.robot.urdf.mesh import first_file, mesh_places
from mobee.robot.urdf.shapes import MOST_VISUALS
from mobee.robot.xml.write import write_xml
from tests.mobee.robot.mjcf_files import mjcf_file
from tests.mobee.robot.urdf_files import ARM, foreign, urdf_file, write_stl

TETRAHEDRON = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
HAND = """<link name="hand"><visual><origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/><geometry><mesh filename="m.stl" scale="1 2 -3"/>
</geometry><material name="blue"/></visual><visual><geometry><box size="1 2 3"/></geometry><material name=""><color rgba="1 0 0 0.5"/>
</material></visual><visual><geometry><sphere radius="-1"/></geometry></visual></link>
<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="1 0 0"/></joint>"""
BLUE = '<material name="blue"><color rgba="0 0 1 1"/></material>'


def key(robot: Robot, visual: Visual) -> tuple[object, ...]:
    mesh, found = visual.mesh, None
    if mesh is not None:
        file = first_file(mesh_places(mesh.file, mesh.robot_file))
        assert file is not None
        found = file.resolve(), mesh.name, mesh.scale
    return robot.links[visual.link], visual.kind, tuple(np.round(visual.size, 12)), visual.color, found


def assert_same_visuals(one: Robot, other: Robot) -> None:
    """Also that the meshes are the same files."""
    assert Counter(key(one, visual) for visual in one.visuals) == Counter(key(other, visual) for visual in other.visuals)
    places = [np.array(sorted([*v.position, *v.rotation.ravel()] for v in robot.visuals)).reshape(-1, 12) for robot in (one, other)]
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)


def test_a_urdf_draws_its_visuals_in_their_colours_and_a_faulty_one_is_a_warning(tmp_path: Path) -> None:
    write_stl(tmp_path / "m.stl", TETRAHEDRON)
    path = urdf_file(tmp_path, BLUE, *ARM, HAND)
    with pytest.warns(Simplified, match=r"toy.urdf:\d+: <visual>: is not drawn: radius: -1 is not positive"):
        robot = load_robot(path)
    mesh, box = robot.visuals
    assert [robot.links[visual.link] for visual in robot.visuals] == ["lower", "lower"]  # the hand is merged into what carries it
    np.testing.assert_allclose(mesh.position, [2.0, 0.0, 0.5])
    np.testing.assert_allclose(mesh.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)
    assert mesh.mesh is not None and (mesh.mesh.file, mesh.mesh.scale) == ("m.stl", (1.0, 2.0, -3.0))
    assert (mesh.color, box.color) == ((0.0, 0.0, 1.0, 1.0), (1.0, 0.0, 0.0, 0.5))
    assert (box.kind, box.size) == ("box", (1.0, 2.0, 3.0))


def test_visuals_beyond_the_most_that_a_robot_may_have_are_a_warning(tmp_path: Path) -> None:
    ball = '<visual><geometry><sphere radius="1"/></geometry></visual>'
    joint = '<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/></joint>'
    path = urdf_file(tmp_path, *ARM, f'<link name="hand">{(MOST_VISUALS + 2) * ball}</link>', joint)
    with pytest.warns(Simplified, match="is not drawn, nor are the others after it: a robot has at most 2000 visuals") as caught:
        robot = load_robot(path)
    assert len(robot.visuals) == MOST_VISUALS
    assert len(caught) == 1


MJCF = """
<asset><mesh name="wedge" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/><material name="gold" rgba="1 .8 0 1"/></asset>
<worldbody>
 <camera name="Over View" pos="0 0 2" xyaxes="0 -1 0 1 0 0" fovy="70"/>
 <camera name="chase" mode="track" pos="1 0 1"/>
 <geom name="floor" type="plane" size="1 1 .1"/>
 <body name="arm"><joint name="pan" axis="0 0 1" range="-1 1"/>
  <geom name="hull" type="box" size=".1 .2 .3"/>
  <geom name="skin" type="mesh" mesh="wedge" material="gold" contype="0" conaffinity="0" pos="0 0 .1" group="2"/>
  <geom name="hidden" type="sphere" size=".1" contype="0" conaffinity="0" group="4"/>
  <geom name="clear" type="sphere" size=".1" contype="0" conaffinity="0" rgba="1 0 0 0"/>
  <body name="tip" pos="0 0 .5"><joint name="nod" axis="0 1 0" range="-1 1"/>
   <geom name="ball" type="ellipsoid" size=".1 .2 .3" rgba="0 255 0 1" material="gold"/>
   <camera name="wrist" pos="0 0 .1" euler="90 0 0"/>
  </body>
 </body>
</worldbody>
"""


@pytest.fixture
def toy(tmp_path: Path) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the floor
        return load_robot(mjcf_file(tmp_path, MJCF))


def test_an_mjcf_draws_geoms_that_cannot_collide_or_else_all(toy: Robot) -> None:
    skin, ball = toy.visuals
    assert [toy.links[visual.link] for visual in toy.visuals] == ["arm", "tip"]
    assert skin.mesh is not None and (skin.kind, skin.mesh.file, skin.mesh.name) == ("mesh", "toy.xml", "wedge")
    assert (ball.kind, ball.size) == ("ellipsoid", (0.1, 0.2, 0.3))
    assert (skin.color, ball.color) == ((1.0, 0.8, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0))  # of the material, unless the geom has its own; 0 to 1


def test_an_mjcf_has_the_cameras_that_are_fixed_to_a_body(toy: Robot) -> None:
    over, wrist = toy.cameras.values()
    assert (over.name, over.link, over.view_deg, toy.links[wrist.link]) == ("Over View", 0, 70.0, "tip")
    np.testing.assert_allclose(over.position, [0.0, 0.0, 2.0])
    np.testing.assert_allclose(over.rotation, [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], atol=1e-9)  # right, down, ahead
    np.testing.assert_allclose(wrist.position, [0.0, 0.0, 0.6])
    np.testing.assert_allclose(wrist.rotation[:, 2], [0.0, 1.0, 0.0], atol=1e-9)


def test_visuals_and_cameras_are_written_as_zero_position_xml_which_names_the_same_meshes(tmp_path: Path, toy: Robot) -> None:
    (tmp_path / "urdf").mkdir()
    (tmp_path / "elsewhere").mkdir()
    write_stl(tmp_path / "urdf" / "m.stl", TETRAHEDRON)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        arm = load_robot(urdf_file(tmp_path / "urdf", BLUE, *ARM, HAND))
    for robot in (toy, arm, load_robot("icub"), load_robot(foreign("franka_panda/panda.urdf"))):
        again = load_robot(write_xml(robot, tmp_path / "elsewhere" / "written.xml"))
        assert_same_visuals(robot, again)
        assert again.cameras.keys() == robot.cameras.keys()
        for name, camera in robot.cameras.items():
            twin = again.cameras[name]
            assert (twin.view_deg, again.links[twin.link]) == (camera.view_deg, robot.links[camera.link])
            np.testing.assert_allclose(twin.rotation, camera.rotation, atol=1e-9)
            np.testing.assert_allclose(twin.position, camera.position, atol=1e-9)
    assert "package://iCub/meshes" in write_xml(load_robot("icub"), tmp_path / "icub.xml").read_text()  # found from everywhere


def test_visuals_and_cameras_of_a_joined_robot_are_where_it_is(toy: Robot) -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    both = join_robots({"": load_robot("katana"), "toy": toy}, {"toy": ([1.0, 2.0, 3.0], turn)})
    skin = both.visuals[0]
    assert both.links[skin.link] == "toy_arm"
    np.testing.assert_allclose(skin.position, turn @ toy.visuals[0].position + [1.0, 2.0, 3.0])
    wrist = both.cameras["toy_wrist"]
    assert (wrist.name, both.links[wrist.link]) == ("toy_wrist", "toy_tip")
    np.testing.assert_allclose(wrist.rotation, turn @ toy.cameras["wrist"].rotation, atol=1e-12)


def test_the_icub_draws_each_mesh_of_its_urdf_where_that_has_it(tmp_path: Path) -> None:
    from mobee.robot.icub_urdf import write_upper_body_urdf

    urdf, icub = load_robot(write_upper_body_urdf(tmp_path / "icub.urdf")), load_robot("icub")
    theirs = {Path(visual.mesh.file).name: visual for visual in urdf.visuals if visual.mesh and "hand" not in visual.mesh.file}
    ours = {Path(visual.mesh.file).name: visual for visual in icub.visuals if visual.mesh}
    assert ours.keys() == theirs.keys() and len(ours) > 15
    for name, visual in ours.items():
        assert icub.links[visual.link] == urdf.links[theirs[name].link]
        np.testing.assert_allclose(visual.position, theirs[name].position, atol=1e-6)
        np.testing.assert_allclose(visual.rotation, theirs[name].rotation, atol=1e-6)
