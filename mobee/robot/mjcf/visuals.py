# SPDX-License-Identifier: Apache-2.0
"""The visuals and the cameras of an MJCF model."""

from __future__ import annotations

import numpy as np

from mobee.robot.mjcf.compiled import Compiled
from mobee.robot.mjcf.shapes import colliding, primitive_size
from mobee.robot.visual import Camera, Channels, MeshSource, Visual, VisualKind

SHOWN_GROUPS = 3  # MuJoCo's viewers show the groups 0, 1 and 2
UNPAINTED = (0.5, 0.5, 0.5, 1.0)  # a geom of this colour has none of its own
KINDS: dict[str, VisualKind] = {name: name for name in ("sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh")}


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
    return round(float(red), 4), round(float(green), 4), round(float(blue), 4), round(float(opacity), 4)


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
