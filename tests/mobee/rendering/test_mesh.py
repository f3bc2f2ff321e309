# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from mobee.errors import RobotFileError, Simplified
from mobee.rendering.camera import NEAREST, Raster, eye_camera, pixel_middles
from mobee.rendering.mesh import Piece, ellipsoid_piece, fair_most, mesh_of, read_pieces, smaller
from mobee.rendering.solid import Solid, coarser, link_solids
from mobee.robot.load import load_robot
from mobee.robot.robot import MeshSource
from tests.mobee.rendering.test_raster import AHEAD, RED, SHAPES, camera, turn
from tests.mobee.robot.urdf_files import ARM, urdf_file, write_stl

SEEDS = Path(__file__).parents[2] / "fuzz" / "seeds"
CUBE = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3, indexing="ij")).reshape(3, -1).T
SQUARES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
TRIANGLES = np.array([[one[0], one[k], one[k + 1]] for one in SQUARES for k in (1, 2)])


def source(path: Path, **about: Any) -> MeshSource:
    return MeshSource(path.name, path.parent / "robot.urdf", **about)


@pytest.mark.parametrize("flipped", [False, True])
def test_a_mesh_of_a_box_is_seen_as_the_box_whichever_side_its_triangles_show(tmp_path: Path, flipped: bool) -> None:
    facets = CUBE[TRIANGLES[:, ::-1] if flipped else TRIANGLES]
    (piece,) = read_pieces(source(write_stl(tmp_path / "cube.stl", facets), scale=(0.2, 0.3, 0.15)))
    assert (len(piece.points), len(piece.triangles), piece.color) == (8, 12, None)
    mesh = mesh_of(piece)
    assert len(mesh.corners) == 24  # an edge has a normal for each of its faces
    place, rotation = np.array([0.1, -0.2, 0.05]), turn(3)
    for eye in (camera(axes=turn(4)), eye_camera(np.array([-0.6, 0.1, 0.2]), AHEAD, 60, 60, 90.0)):
        box = Raster(eye, [Solid("box", (0.2, 0.3, 0.15), place, rotation, RED)])
        seen = Raster(eye, [Solid("mesh", (), place, rotation, RED, mesh=mesh)])
        both = np.isfinite(box.depth) & np.isfinite(seen.depth)
        assert (np.isfinite(box.depth) != np.isfinite(seen.depth)).sum() <= 2  # pixels on an edge
        np.testing.assert_allclose(seen.depth[both], box.depth[both], atol=1e-4)
        assert both.sum() > 50
        assert (np.abs(seen.normal[both] - box.normal[both]).max(axis=1) < 1e-3).mean() > 0.98


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6))
def test_an_eye_sees_a_triangle_where_its_rays_cross_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (3, 3))  # at times behind the eye, or through its nearest plane
    mesh = mesh_of(Piece(points, np.array([[0, 1, 2]])))
    eye = eye_camera(rng.uniform(-0.3, 0.3, 3), turn(seed + 1), 12, 12, 90.0)
    seen = Raster(eye, [Solid("mesh", (), np.zeros(3), np.eye(3), RED, mesh=mesh)])
    right, up = pixel_middles(eye)
    rays = right[:, None] * eye.axes[0] + up[:, None, None] * eye.axes[1] + eye.axes[2]
    assert eye.eye is not None
    system = np.stack(np.broadcast_arrays(rays, points[0] - points[1], points[0] - points[2]), axis=-1)
    depth, v, w = np.moveaxis(np.linalg.solve(system, np.broadcast_to(points[0] - eye.eye, rays.shape)[..., None])[..., 0], -1, 0)
    margin = np.minimum.reduce([v, w, 1.0 - v - w, 10.0 * (depth - NEAREST)])
    assert np.isfinite(seen.depth[margin > 1e-3]).all() and np.isinf(seen.depth[margin < -1e-3]).all()
    np.testing.assert_allclose(seen.depth[margin > 1e-3], depth[margin > 1e-3], rtol=1e-4)
    assert (np.einsum("ijk,ijk->ij", seen.normal, rays)[np.isfinite(seen.depth)] < 0.0).all()  # towards the eye


def test_a_mesh_and_volumes_hide_each_other_and_keep_their_numbers() -> None:
    mesh = mesh_of(Piece(0.2 * CUBE, TRIANGLES))
    near = Solid("mesh", (), np.array([-0.5, 0.0, 0.0]), np.eye(3), RED, group=7, mesh=mesh)
    far = Solid("mesh", (), np.array([0.5, 0.1, 0.0]), np.eye(3), RED, group=9, mesh=mesh)
    for solids in ([SHAPES[3], near, far], [far, near, SHAPES[3]]):
        seen = Raster(camera(), solids)
        assert seen.group[25, 25] == 7 and {9, 7, 0, -1} == set(np.unique(seen.group))
        assert seen.which[25, 25] == 1


def test_round_surfaces_have_round_normals() -> None:
    mesh = mesh_of(ellipsoid_piece((0.2, 0.2, 0.2)))
    np.testing.assert_allclose(mesh.normals, mesh.corners / 0.2, atol=0.05)  # a polyhedron
    assert mesh.radius == pytest.approx(0.2)


def test_colours_and_units_of_a_collada_file_count() -> None:
    from mobee.robot.urdf.mesh import read_mesh

    pieces = read_pieces(source(SEEDS / "every_tag.dae"))
    points, own = np.vstack([piece.points for piece in pieces]), read_mesh(SEEDS / "every_tag.dae")
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [own.min(axis=0), own.max(axis=0)], atol=1e-6)


def test_a_budget_is_dealt_to_the_large_ones() -> None:
    assert fair_most([10, 20, 30], 100) == 30
    assert fair_most([10, 1000, 1000], 1010) == 500
    fine = ellipsoid_piece((0.1, 0.2, 0.3))
    coarse = smaller(fine, 100)
    assert len(coarse.triangles) <= 100
    np.testing.assert_allclose(np.ptp(coarse.points, axis=0), [0.2, 0.4, 0.6], rtol=0.1)
    assert smaller(fine, 10_000) is fine


@pytest.mark.parametrize(("name", "content", "why"), [("m.dae", b"<x", "cannot be read"), ("m.xyz", b"", "meshes of type '.xyz'")])
def test_a_mesh_that_cannot_be_read_is_an_error_with_its_reason(tmp_path: Path, name: str, content: bytes, why: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RobotFileError, match=f"{name}: {why}"):
        read_pieces(source(tmp_path / name))
    with pytest.raises(RobotFileError, match="no mesh 'absent.stl'"):
        read_pieces(source(tmp_path / "absent.stl"))


def test_a_mesh_whose_texture_is_cut_off_is_an_error_with_its_reason(tmp_path: Path) -> None:
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)).save(tmp_path / "t.png")
    (tmp_path / "t.png").write_bytes((tmp_path / "t.png").read_bytes()[:5000])
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd t.png\n")
    (tmp_path / "m.obj").write_text("mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    with pytest.raises(RobotFileError, match="m.obj: cannot be read"):
        read_pieces(source(tmp_path / "m.obj"))


SOLID = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
VISUAL = f'<link name="hand"><visual><geometry><mesh filename="{{}}"/></geometry></visual>{SOLID}</link>'
WRIST = '<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/></joint>'


def test_a_mirror_image_keeps_its_outside_and_a_coarser_mesh_its_shape(tmp_path: Path) -> None:
    fine = ellipsoid_piece((0.5, 0.4, 0.3))
    write_stl(tmp_path / "ball.stl", fine.points[fine.triangles])
    robot = load_robot(urdf_file(tmp_path, *ARM, VISUAL.format('ball.stl" scale="-1 1 1'), WRIST))
    (one,) = coarser(link_solids(robot), 200)
    mesh = one.solid.mesh
    assert mesh is not None and 100 < len(mesh.triangles) <= 200
    assert ((mesh.corners * mesh.normals).sum(axis=1) > 0.0).all()
    np.testing.assert_allclose(np.ptp(mesh.corners, axis=0), [1.0, 0.8, 0.6], rtol=0.1)


def test_a_missing_mesh_is_one_line_and_the_solid_instead(tmp_path: Path) -> None:
    robot = load_robot(urdf_file(tmp_path, *ARM, VISUAL.format("absent.stl"), WRIST))
    with pytest.warns(Simplified) as caught:
        (one,) = link_solids(robot)
    assert (one.solid.kind, one.collides) == ("sphere", True)
    (line,) = [str(one.message) for one in caught]
    assert line.startswith(f"{tmp_path / 'toy.urdf'}:7: cannot draw absent.stl: no mesh 'absent.stl' (looked at") and line.endswith(
        "nothing else is"
    )
    write_stl(tmp_path / "absent.stl", CUBE[TRIANGLES])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (one,) = link_solids(replace(robot, name="again"))
    assert one.solid.mesh is not None and not one.collides
