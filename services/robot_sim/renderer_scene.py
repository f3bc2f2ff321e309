"""The scene of the eyes: the robot's solids drawn by PyBullet on the CPU, and the world around it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pybullet
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.model.quaternion import from_matrix, to_matrix
from mobee.model.world import World, WorldObject
from mobee.robot.robot import Robot, Shape
from mobee.robot.urdf.hull import facets
from services.common.eyes import eye_frame
from services.robot_sim.renderer_cast import CastBox, CastSphere, Floats, Picture, paint_box, paint_sphere, pixel_rays

NEAR, FAR = 0.03, 3.0  # m
BACKGROUND = (168, 174, 182)
NEUTRAL = {"torso": (0.62, 0.64, 0.67, 1.0), "left_arm": (0.78, 0.79, 0.80, 1.0), "right_arm": (0.70, 0.71, 0.73, 1.0)}
Color = tuple[float, float, float, float]
DEFAULT_COLOR = (0.6, 0.6, 0.55, 1.0)
LIGHT = np.array([0.37, -0.24, 0.90])  # unit vector towards it: behind, left of and above the robot


class Scene:
    """Bodies that are put where the robot's links are, and a camera in each eye."""

    def __init__(self, robot: Robot, world: World, width: int = 320, height: int = 240, view_deg: float = 50.0) -> None:
        self._robot, self._width, self._height = robot, width, height
        self._client = pybullet.connect(pybullet.DIRECT)
        self.intrinsics = _intrinsics(width, height, view_deg)
        self._projection = pybullet.computeProjectionMatrixFOV(view_deg, width / height, NEAR, FAR)
        self._rays = pixel_rays(width, height, self.intrinsics)
        self._links = self._make_links()
        self._boxes: dict[str, CastBox] = {}
        self._spheres: dict[str, CastSphere] = {}
        self._bodies: dict[str, int] = {}
        for thing in world.objects.values():
            self._add(thing)
        self._transforms = link_transforms(robot, robot.home)
        self.pose(robot.home)

    def close(self) -> None:
        """Give the memory of the drawing back."""
        pybullet.disconnect(self._client)

    def pose(self, q: Array) -> None:
        """Put the robot's links where they are at q (n,) in rad."""
        self._transforms = link_transforms(self._robot, q)
        quaternions = from_matrix(self._transforms[:, :3, :3])[:, [1, 2, 3, 0]]
        for link, bodies in self._links.items():
            at, turn = self._transforms[link, :3, 3].tolist(), quaternions[link].tolist()
            for body in bodies:
                pybullet.resetBasePositionAndOrientation(body, at, turn, physicsClientId=self._client)

    def place(self, name: str, position: Array, quaternion: Array) -> None:
        """Put an object of the world somewhere: (3,) m, quaternion wxyz; what the world does not hold is passed over."""
        if name in self._spheres:
            self._spheres[name] = replace(self._spheres[name], position=position)
        elif name in self._boxes:
            self._boxes[name] = replace(self._boxes[name], position=position, rotation=to_matrix(quaternion))
        elif name in self._bodies:
            w, x, y, z = quaternion.tolist()
            pybullet.resetBasePositionAndOrientation(self._bodies[name], position.tolist(), [x, y, z, w], physicsClientId=self._client)

    def draw(self, eye: str) -> Picture:
        """The picture of the eye "left" or "right": (height, width, 3) bytes, red, green, blue."""
        origin, rotation = eye_frame(self._robot, self._transforms, eye)
        picture, depth = self._rasterise(origin, rotation)
        for box in self._boxes.values():
            paint_box(box, picture, depth, self._rays, origin, rotation)
        for ball in self._spheres.values():
            paint_sphere(ball, picture, depth, self._rays, origin, rotation, LIGHT)
        return picture

    def _rasterise(self, origin: Array, rotation: Array) -> tuple[Picture, Floats]:
        view = pybullet.computeViewMatrix(origin.tolist(), (origin + rotation[:, 2]).tolist(), (-rotation[:, 1]).tolist())
        image = pybullet.getCameraImage(
            self._width,
            self._height,
            view,
            self._projection,
            lightDirection=LIGHT.tolist(),
            lightAmbientCoeff=0.65,
            lightDiffuseCoeff=0.4,
            lightSpecularCoeff=0.05,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
            physicsClientId=self._client,
        )
        shape = (self._height, self._width)
        picture = np.array(image[2], dtype=np.uint8).reshape(*shape, 4)[..., :3].copy()
        buffer = np.array(image[3], dtype=np.float32).reshape(shape)
        depth = FAR * NEAR / (FAR - (FAR - NEAR) * buffer)
        nothing = depth > 0.99 * FAR
        picture[nothing] = BACKGROUND
        depth[nothing] = np.inf
        return picture, depth

    def _make_links(self) -> dict[int, list[int]]:
        """The bodies of each link: one of its primitives, and one a hull; the head's own shapes are left out, the eyes are inside them."""
        bodies: dict[int, list[int]] = {}
        for link in range(len(self._robot.links)):
            shapes = [s for s in self._robot.shapes if s.link == link and s.role == "solid" and s.part != "head"]
            primitives = [shape for shape in shapes if shape.kind != "convex"]
            made = [self._make_body(primitives, _color(primitives[0]))] if primitives else []
            bodies[link] = made + [self._make_hull(shape, _color(shape)) for shape in shapes if shape.kind == "convex"]
        return bodies

    def _add(self, thing: WorldObject) -> None:
        color = thing.color or DEFAULT_COLOR
        paint = 255.0 * np.array(color[:3])
        if thing.kind == "box":
            self._boxes[thing.name] = CastBox(np.array(thing.size), thing.position, thing.rotation, paint)
            return
        if thing.kind == "sphere":
            self._spheres[thing.name] = CastSphere(thing.size[0], thing.position, paint)
            return
        own = Shape(thing.name, 0, thing.kind, thing.size, np.zeros(3), np.eye(3), "solid", "")
        self._bodies[thing.name] = self._make_body([own], color)
        self.place(thing.name, thing.position, from_matrix(thing.rotation))

    def _make_body(self, shapes: list[Shape], color: Color) -> int:
        visual = [_visual(shape) for shape in shapes]
        index = pybullet.createVisualShapeArray(
            shapeTypes=[v[0] for v in visual],
            radii=[v[1] for v in visual],
            halfExtents=[v[2] for v in visual],
            lengths=[v[3] for v in visual],
            visualFramePositions=[shape.position.tolist() for shape in shapes],
            visualFrameOrientations=[from_matrix(shape.rotation)[[1, 2, 3, 0]].tolist() for shape in shapes],
            rgbaColors=[list(color)] * len(shapes),
            physicsClientId=self._client,
        )
        return int(pybullet.createMultiBody(baseVisualShapeIndex=index, physicsClientId=self._client))

    def _make_hull(self, shape: Shape, color: Color) -> int:
        """A body of triangles with flat faces, which the array of primitives above cannot hold."""
        local = facets(np.empty((0, 3)) if shape.vertices is None else shape.vertices)
        corners = local @ shape.rotation.T + shape.position
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        index = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=corners.reshape(-1, 3).tolist(),
            indices=list(range(3 * len(corners))),
            normals=np.repeat(normals, 3, axis=0).tolist(),
            rgbaColor=list(color),
            physicsClientId=self._client,
        )
        return int(pybullet.createMultiBody(baseVisualShapeIndex=index, physicsClientId=self._client))


def _color(shape: Shape) -> Color:
    return NEUTRAL.get(shape.part, DEFAULT_COLOR)


def _visual(shape: Shape) -> tuple[int, float, list[float], float]:
    """PyBullet's (type, radius, half extents, length)."""
    if shape.kind == "box":
        return pybullet.GEOM_BOX, 1.0, [edge / 2.0 for edge in shape.size], 1.0
    kinds = {"sphere": pybullet.GEOM_SPHERE, "cylinder": pybullet.GEOM_CYLINDER, "capsule": pybullet.GEOM_CAPSULE}
    return kinds[shape.kind], shape.size[0], [1.0, 1.0, 1.0], shape.size[-1]


def _intrinsics(width: int, height: int, view_deg: float) -> NDArray[np.float64]:
    """Pixel centres at integers, origin top left.

    TinyRenderer samples where normalised coordinates fall on integers of a grid that counts rows from the bottom:
    the axis of view meets column width / 2 and row height / 2 - 1.
    """
    focal = height / 2.0 / math.tan(math.radians(view_deg) / 2.0)
    return np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0 - 1.0], [0.0, 0.0, 1.0]])
