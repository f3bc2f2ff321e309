# SPDX-License-Identifier: Apache-2.0
"""Adds a robot's links, joints and volumes to a MuJoCo specification.

The MuJoCo back-end of robot_sim uses it, and a benchmark that compares this library with MuJoCo.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from mobee.arrays import Array
from mobee.model.kinematics import quaternion_from_matrix
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Robot, Shape

JOINTS = {"revolute": mujoco.mjtJoint.mjJNT_HINGE, "prismatic": mujoco.mjtJoint.mjJNT_SLIDE}
GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "convex": mujoco.mjtGeom.mjGEOM_MESH,
}


def link_name(link: int) -> str:
    """Return the name of a link's body in MuJoCo: "link" and the link's number, since a world object may have the same name as a link."""
    return f"link{link}"


def joint_name(joint: int) -> str:
    """Return the name of a joint in MuJoCo: "joint" and the number of the joint."""
    return f"joint{joint}"


def add_tree(spec: Any, robot: Robot, weigh: Callable[[Any, int, Array], None]) -> tuple[list[Any], Array]:
    """Add a body for each link of the robot, and its joint, to a MuJoCo specification.

    `spec`: the specification (mujoco.MjSpec). Returns the bodies, and the origins (L, 3) m of their frames in the root frame at zero pose.
    The axes of all frames are those of the root frame at zero pose. `weigh(body, link, origin)`: called for each link, to give its
    body a mass; `link`: number of the link, `origin`: (3,) m, origin of the body's frame in the root frame at zero pose.
    """
    bodies = [spec.worldbody.add_body(name=link_name(0))]
    origins = [np.zeros(3)]
    for index, joint in enumerate(robot.joints):
        body = bodies[joint.parent].add_body(name=link_name(index + 1), pos=joint.point - origins[joint.parent])
        body.add_joint(name=joint_name(index), type=JOINTS[joint.kind], axis=joint.axis)
        bodies.append(body)
        origins.append(joint.point)
    for link, (body, origin) in enumerate(zip(bodies, origins, strict=True)):
        weigh(body, link, origin)
    return bodies, np.array(origins)


def add_volume(spec: Any, body: Any, name: str, volume: Shape | WorldObject, position: Array) -> Any:
    """Add a volume to a body as a geom with the given name; return the geom.

    `spec`: the MuJoCo specification. `position`: (3,) m, centre of the volume in the body's frame.
    """
    size = np.zeros(3)
    size[: len(volume.size)] = volume.size
    size[slice(None) if volume.kind == "box" else slice(1, None)] /= 2.0  # MuJoCo has half lengths
    geom = body.add_geom(name=name, type=GEOMS[volume.kind], pos=position, quat=quaternion_from_matrix(volume.rotation), margin=0.0)
    if isinstance(volume, Shape) and volume.vertices is not None:
        mesh = spec.add_mesh(name=name, uservert=volume.vertices.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
        geom.meshname = mesh.name
    else:
        geom.size = size
    return geom
