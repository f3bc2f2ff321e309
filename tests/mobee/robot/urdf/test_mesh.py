# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.urdf.mesh import read_mesh
from tests.mobee.robot.urdf_files import foreign, tetrahedron, write_stl

CORNERS = np.unique(tetrahedron(0.5).reshape(-1, 3), axis=0)
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit meter="{unit}" name="x"/><up_axis>Y_UP</up_axis></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="12">{numbers}</float_array></source>
  <source id="n"><float_array id="b" count="3">9 9 9</float_array></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{faces}
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>
</COLLADA>
"""
PLAIN = '<node><instance_geometry url="#g"/></node>'


def dae(folder: Path, unit: str = "1", numbers: str | None = None, scene: str = PLAIN, faces: str = "") -> Path:
    path = folder / "m.dae"
    text = " ".join(map(str, CORNERS.reshape(-1))) if numbers is None else numbers
    path.write_text(DAE.format(unit=unit, numbers=text, scene=scene, faces=faces), encoding="utf-8")
    return path


def text_stl(folder: Path) -> Path:
    lines = ["solid t"]
    for facet in tetrahedron(0.5):
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in facet), "endloop", "endfacet"]
    path = folder / "m.STL"
    path.write_text("\n".join([*lines, "endsolid t"]))
    return path


def obj(folder: Path) -> Path:
    path = folder / "m.obj"
    points = "".join(f"v {x} {y} {z} 1.0\n" for x, y, z in CORNERS)
    path.write_text(f"# a comment\no t\nvn 0 0 1\nvt 0 0\n{points}f 1//1 2//1 3//1\nf 1 4 \\\n3\n")
    return path


def test_every_format_gives_the_same_points(tmp_path: Path) -> None:
    assert np.array_equal(read_mesh(write_stl(tmp_path / "m.stl", tetrahedron(0.5))), CORNERS)
    assert np.array_equal(read_mesh(text_stl(tmp_path)), CORNERS)
    assert np.array_equal(read_mesh(obj(tmp_path)), CORNERS)
    assert np.array_equal(read_mesh(dae(tmp_path)), CORNERS)


TRIANGLES = (
    '<triangles count="1"><input semantic="NORMAL" source="#n" offset="1"/><input semantic="VERTEX" source="#v" offset="0"/>'
    "<p>{0}</p></triangles>"
)


def test_points_that_no_face_has_are_left_out(tmp_path: Path) -> None:
    """Exporters write one array of points for many meshes, of which each shows some (Romeo's trunk)."""
    assert np.array_equal(read_mesh(dae(tmp_path, faces=TRIANGLES.format("0 0 3 0 1 0"))), CORNERS[[0, 1, 3]])
    more = TRIANGLES.format("0 0 2 0 2 0") + TRIANGLES.format("") + TRIANGLES.format("3 0 3 0 3 0").replace("triangles", "polylist")
    assert np.array_equal(read_mesh(dae(tmp_path, faces=more)), CORNERS[[0, 2, 3]])
    path = obj(tmp_path)
    path.write_text(path.read_text() + "v 9 9 9\n")
    assert np.array_equal(read_mesh(path), CORNERS)


def test_faces_that_count_back_leave_all_points_of_an_obj(tmp_path: Path) -> None:
    path = obj(tmp_path)
    path.write_text(path.read_text() + "v 9 9 9\nf -1 -2 -3\n")
    assert np.array_equal(read_mesh(path), [*CORNERS, [9, 9, 9]])


def test_a_binary_stl_may_begin_like_a_text(tmp_path: Path) -> None:
    path = write_stl(tmp_path / "m.stl", tetrahedron(0.5))
    path.write_bytes(b"solid" + path.read_bytes()[5:])
    assert np.array_equal(read_mesh(path), CORNERS)


def test_a_binary_stl_may_have_more_behind_its_facets(tmp_path: Path) -> None:
    path = write_stl(tmp_path / "m.stl", tetrahedron(0.5))
    path.write_bytes(path.read_bytes() + b"colours")
    assert np.array_equal(read_mesh(path), CORNERS)


def test_collada_is_read_in_its_unit_and_where_its_scene_places_it(tmp_path: Path) -> None:
    assert np.allclose(read_mesh(dae(tmp_path, unit="0.01")), 0.01 * CORNERS)
    turned = (
        '<node><translate>1 2 3</translate><rotate>0 0 1 90</rotate><scale>2 2 2</scale><node><instance_geometry url="#g"/></node></node>'
    )
    wanted = np.unique(np.round(2 * CORNERS @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] + [1, 2, 3], 12), axis=0)
    assert np.allclose(np.unique(np.round(read_mesh(dae(tmp_path, scene=turned)), 12), axis=0), wanted)
    matrix = '<node><matrix>1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/></node>'
    assert np.allclose(read_mesh(dae(tmp_path, scene=matrix)), CORNERS + [5, 0, 0])


@pytest.mark.parametrize("name", ["racecar/meshes/chassis.dae", "duck.dae", "racecar/meshes/hokuyo.dae"])
def test_collada_of_other_makers_is_read(name: str) -> None:
    points = read_mesh(foreign(name))
    assert len(points) > 100
    assert np.ptp(points, axis=0).min() > 0


SELF = '<node id="a"><instance_node url="#a"/></node>'
BOMB = "".join(f'<node id="n{k}"><instance_node url="#n{k + 1}"/><instance_node url="#n{k + 1}"/></node>' for k in range(60))
ENTITY = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>\n<COLLADA>&b;</COLLADA>'
BROKEN: dict[str, tuple[str, bytes, str]] = {
    "empty": ("m.stl", b"", "not a complete STL file: it is too short"),
    "cut": ("m.stl", b"\0" * 80 + b"\x05\0\0\0" + b"\0" * 60, "announces 5 facets and has room for 1"),
    "cut long": ("m.stl", b"\0" * 80 + b"\xff\xff\xff\xff" + b"\0" * 50, "announces 4294967295 facets and has room for 1"),
    "no facets": ("m.stl", b"\0" * 84, "holds no points"),
    "nan": ("m.stl", b"\0" * 80 + b"\x01\0\0\0" + b"\xff" * 50, "not finite or farther than"),
    "text of nothing": ("m.stl", b"solid x\nendsolid x", "holds no points"),
    "text with a word": ("m.stl", b"solid x\nvertex 1 2 x\n", "a coordinate is no number"),
    "text cut short": ("m.stl", b"solid x\nvertex 1 2", "1 of 1 vertices lack a coordinate"),
    "text infinite": ("m.stl", b"solid x\nvertex 1 2 inf\n", "not finite or farther"),
    "noise": ("m.obj", bytes(range(256)) * 40, "holds no points"),
    "obj word": ("m.obj", b"v 1 2 three\n", "a coordinate is no number"),
    "obj of two": ("m.obj", b"v 1 2\n", "1 of 1 vertices lack"),
    "obj far": ("m.obj", b"v 1 2 1e300\n", "not finite or farther"),
    "obj face of words": ("m.obj", b"v 1 2 3\nf one two\n", "a face is no list of vertices"),
    "obj face beyond": ("m.obj", b"v 1 2 3\nf 1 2 1\n", "a face names a vertex beyond the 1 that there are"),
    "obj face of zero": ("m.obj", b"v 1 2 3\nf 0 1 1\n", "a face names a vertex beyond the 1 that there are"),
    "no xml": ("m.dae", b"solid", "not well-formed XML"),
    "entity bomb": ("m.dae", ENTITY.encode(), "entities and external references are refused"),
    "deep": ("m.dae", b"<a>" * 500 + b"</a>" * 500, "more than 100 elements deep"),
    "other xml": ("m.dae", b"<a/>", "holds no points"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_mesh_is_refused_with_a_remedy(tmp_path: Path, name: str) -> None:
    file, content, message = BROKEN[name]
    (tmp_path / file).write_bytes(content)
    with pytest.raises(RobotFileError, match=message) as caught:
        read_mesh(tmp_path / file)
    assert file in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"numbers": "1 2 x"}, "<float_array>: holds no number"),
        ({"numbers": "1 2 3 4"}, "<float_array>: holds 4 numbers, not a multiple of 3"),
        ({"numbers": ""}, "<float_array>: holds 0 numbers"),
        ({"unit": "nan"}, "<unit>: holds 1 numbers, not a multiple of 1 finite ones"),
        ({"scene": "<node><rotate>0 0 0 90</rotate></node>"}, "<rotate>: the axis has no length"),
        ({"faces": TRIANGLES.format("0 0 4 0 1 0")}, "<geometry>: a face names a point beyond the 4 of 'p'"),
        ({"faces": TRIANGLES.format("0 0 -1 0 1 0")}, "<geometry>: a face names a point beyond the 4 of 'p'"),
        ({"faces": TRIANGLES.format("0 0 3")}, "<p>: holds 3 numbers, not a multiple of 2"),
        ({"faces": TRIANGLES.format("0 0").replace('"1"', '"-1"')}, "<input>: offset '-1' is not a whole number"),
        ({"scene": SELF}, "the scene holds more than"),
        ({"scene": BOMB}, "the scene holds more than"),
    ],
)
def test_broken_collada_is_refused_with_its_line(tmp_path: Path, change: dict[str, str], message: str) -> None:
    with pytest.raises(RobotFileError, match=rf"m\.dae:\d+: .*{message}|m\.dae:\d+: {message}"):
        read_mesh(dae(tmp_path, **change))


def test_a_path_without_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="cannot be read .No such file"):
        read_mesh(tmp_path / "m.stl")
    os.mkfifo(tmp_path / "pipe.stl")
    with pytest.raises(RobotFileError, match="is not a regular file"):
        read_mesh(tmp_path / "pipe.stl")
    with pytest.raises(RobotFileError, match="meshes of type '.step' cannot be read"):
        read_mesh(tmp_path / "m.step")
