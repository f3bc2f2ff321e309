# SPDX-License-Identifier: Apache-2.0
"""Reads the geoms and cameras of an MJCF model: solids from the geoms that can collide, visuals from those that are drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, RobotFileError
from mobee.robot.mjcf.compiled import Compiled
from mobee.robot.robot import Camera, Channels, MeshSource, Shape, ShapeKind, Visual, VisualKind
from mobee.robot.urdf.hull import Corners, convex_hull
from mobee.robot.urdf.shapes import Meshes, hulled
from mobee.robot.xml.body import MOST_SHAPES

PRIMITIVES: dict[str, ShapeKind] = {name: name for name in ("sphere", "capsule", "cylinder", "box")}
WITHOUT_BODY = ("plane", "hfield")  # ground, which belongs into a world
SHOWN_GROUPS = 3  # MuJoCo's viewers show the groups 0, 1 and 2
UNPAINTED = (0.5, 0.5, 0.5, 1.0)  # a geom of this colour has none of its own
KINDS: dict[str, VisualKind] = {name: name for name in ("sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh")}


def read_solids(compiled: Compiled, link_of: list[int], meshes: Meshes, corners: Corners) -> Iterator[tuple[Shape, int]]:
    """Yield the solid of each geom that can collide, with MuJoCo's number of the geom; the ground (plane, height field) is left out.

    `link_of`: for each body the index of the robot's link. `meshes`: "hull" (convex hull of a mesh) or "bounding" (smallest primitive
    around it). `corners`: largest number of corners of a hull, or "all". Geoms that are only drawn (contype and conaffinity 0, in no
    contact pair) are left out, unless the model has no other geoms.
    """
    known: dict[int, Array] = {}
    chosen = colliding(compiled)
    if len(chosen) > MOST_SHAPES:
        raise RobotFileError(f"{compiled.path}: more than {MOST_SHAPES} geoms collide. Join small geoms, or set their contype to 0.")
    for geom in chosen:
        frame, size = compiled.geoms[geom], compiled.model.geom_size[geom]
        link = link_of[int(compiled.model.geom_bodyid[geom])]
        shape = Shape(compiled.names["geom"][geom], link, "sphere", (), frame.position, frame.rotation, "solid", "all")
        yield _shaped(compiled, geom, shape, size, known, meshes, corners), geom


def colliding(compiled: Compiled) -> list[int]:
    """Return MuJoCo's numbers of the geoms that can collide, or of all geoms if none can; planes and height fields are never included."""
    model = compiled.model
    solid = [geom for geom, kind in enumerate(compiled.geom_kinds) if kind not in WITHOUT_BODY]
    paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    found = [geom for geom in solid if model.geom_contype[geom] or model.geom_conaffinity[geom] or geom in paired]
    return found or solid


def _shaped(compiled: Compiled, geom: int, shape: Shape, size: Array, known: dict[int, Array], meshes: Meshes, corners: Corners) -> Shape:
    kind = compiled.geom_kinds[geom]
    if kind in PRIMITIVES:
        return replace(shape, kind=PRIMITIVES[kind], size=primitive_size(kind, size))
    if kind == "ellipsoid":
        return hulled(shape, around_ball() * size, meshes)
    return hulled(shape, _mesh(compiled, geom, known, corners), meshes)


def primitive_size(kind: str, size: Array) -> tuple[float, ...]:
    """Convert the size of a MuJoCo geom (3,) m, which has half lengths, to that of a `mobee.robot.robot.Shape`, which has full lengths.

    `kind`: "sphere", "capsule", "cylinder" or "box".
    """
    x, y, z = map(float, size)
    match kind:
        case "sphere":
            return (x,)
        case "box":
            return 2.0 * x, 2.0 * y, 2.0 * z
    return x, 2.0 * y


def _mesh(compiled: Compiled, geom: int, known: dict[int, Array], corners: Corners) -> Array:
    """Return the vertices (v, 3) m of the hull of a geom's mesh, in the geom's frame."""
    model = compiled.model
    mesh = int(model.geom_dataid[geom])
    if mesh < 0:
        raise RobotFileError(
            f"{compiled.where('geom', geom)}: a geom of type {compiled.geom_kinds[geom]} has no mesh. Draw a mesh, box or capsule instead."
        )
    if mesh not in known:
        start = int(model.mesh_vertadr[mesh])
        points = model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])].astype(np.float64)
        try:
            known[mesh] = convex_hull(points, corners)
        except InvalidValue as error:
            raise RobotFileError(
                f"{compiled.where('geom', geom)}: {error}. Export the mesh again, or draw a box or capsule instead."
            ) from None
    return known[mesh]


def around_ball() -> Array:
    """Return the corners (32, 3) of a polyhedron that contains the ball of radius 1: those of a dodecahedron and an icosahedron."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    twelve = [np.roll((0.0, a, b), k) for a, b in product((-1.0, 1.0), (-golden, golden)) for k in range(3)]
    twenty = [
        *product((-1.0, 1.0), repeat=3),
        *(np.roll((0.0, a, b), k) for a, b in product((-1 / golden, 1 / golden), (-golden, golden)) for k in range(3)),
    ]
    corners = np.array([*twelve, *twenty])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    from scipy.spatial import ConvexHull  # 0.3 s, and only robots with ellipsoids need it

    nearest = float(-ConvexHull(corners).equations[:, 3].max())
    held: Array = corners / nearest
    return held


def read_visuals(compiled: Compiled, link_of: list[int]) -> tuple[Visual, ...]:
    """Return the visuals (drawn shapes) of an MJCF model: for each body the geoms that cannot collide, or all its geoms if all can collide.

    Only geoms of the groups 0 to 2 are taken, which MuJoCo's viewers show. The ground (planes and height fields) and geoms that are fully
    transparent are left out.  `link_of`: for each body the index of the robot's link.
    """
    model, solid = compiled.model, set(colliding(compiled))
    shown = [
        geom
        for geom, kind in enumerate(compiled.geom_kinds)
        if kind in KINDS and model.geom_group[geom] < SHOWN_GROUPS and _color(compiled, geom)[3] > 0.0
    ]
    decorated = {int(model.geom_bodyid[geom]) for geom in shown if geom not in solid}
    return tuple(_visual(compiled, geom, link_of) for geom in shown if geom not in solid or int(model.geom_bodyid[geom]) not in decorated)


def _visual(compiled: Compiled, geom: int, link_of: list[int]) -> Visual:
    model, kind = compiled.model, KINDS[compiled.geom_kinds[geom]]
    frame, link, color = compiled.geoms[geom], link_of[int(model.geom_bodyid[geom])], _color(compiled, geom)
    size: tuple[float, ...] = ()
    mesh = None
    if kind == "ellipsoid":
        size = tuple(map(float, model.geom_size[geom]))
    elif kind != "mesh":
        size = primitive_size(kind, model.geom_size[geom])
    else:
        name = compiled.names["mesh"][int(model.geom_dataid[geom])]
        mesh = MeshSource(compiled.path.name, compiled.path, max(compiled.lines["geom"][geom], 1), name)
    return Visual(link, kind, size, frame.position, frame.rotation, color, mesh)


def _color(compiled: Compiled, geom: int) -> Channels:
    """Return the colour of a geom: its own, or that of its material, which is the mean of its texture if it has one."""
    model = compiled.model
    own, material = tuple(model.geom_rgba[geom].tolist()), int(model.geom_matid[geom])
    painted = not np.allclose(own, UNPAINTED)
    red, green, blue, opacity = own if painted or material < 0 else model.mat_rgba[material].tolist()
    textures = [texture for texture in np.ravel(model.mat_texid[material]).tolist() if texture >= 0] if material >= 0 else []
    if textures:
        start, channels = int(model.tex_adr[textures[0]]), int(model.tex_nchannel[textures[0]])
        count = int(model.tex_height[textures[0]] * model.tex_width[textures[0]]) * channels
        mean = model.tex_data[start : start + count].reshape(-1, channels)[:, :3].mean(axis=0) / 255.0
        red, green, blue = (np.array([red, green, blue]) * mean).tolist()
    red, green, blue, opacity = np.clip([red, green, blue, opacity], 0.0, 1.0).round(4).tolist()  # MuJoCo accepts other numbers
    return red, green, blue, opacity


def read_cameras(compiled: Compiled, link_of: list[int]) -> dict[str, Camera]:
    """Return the cameras that are fixed to a body, by name; cameras that follow a body from a distance are left out.

    `link_of`: for each body the index of the robot's link.
    """
    model, found = compiled.model, {}
    for index, name in enumerate(compiled.names["camera"]):
        if compiled.camera_modes[index] == "fixed":
            frame = compiled.cameras[index]
            rotation = frame.rotation * np.array([1.0, -1.0, -1.0])  # MuJoCo's cameras view along -z, and y is up
            link = link_of[int(model.cam_bodyid[index])]
            found[name] = Camera(name, link, frame.position, rotation, float(model.cam_fovy[index]))
    return found
