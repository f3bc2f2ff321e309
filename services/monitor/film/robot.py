# SPDX-License-Identifier: Apache-2.0
"""The picture of the robot in a film: robot, world, the hand's position in each state of an agent, and the agent's plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world import World
from mobee.model.world_object import Geometry
from mobee.rendering.camera import Camera, camera_axes, framing
from mobee.rendering.palette import Color
from mobee.rendering.picture import draw
from mobee.rendering.solid import LinkSolid, Solid, focus, link_solids, object_solids
from mobee.robot.robot import Robot
from services.common.worlds import AT_TABLE
from services.monitor.film.ink import GROUND, LEARNED, TEXT, WHITE, dot, mixed

HEADING = 30  # pixels for the text above the robot
USUAL = 0.1  # share of the moments at which something may be beyond an edge
MARGIN = 0.02  # m around what the camera must see
RAYS = 2  # a pixel, in each direction
TINT = 0.4  # share of an agent's colour in that of its part, as on the page
FIRST_VIEW, OTHER_VIEW = (-32.0, 22.0), (148.0, 22.0)  # azimuth, elevation [degrees]: of robots that look along -x, and of the others


class RobotView:
    """Draws the robot of a run, seen by a camera that does not move."""

    def __init__(self, robot: Robot, colors: Mapping[str, Color], size: tuple[int, int], moments: Sequence[dict[str, Any]]) -> None:
        """Choose the camera.

        `colors`: colour of each part. `size`: width and height of the pictures [pixels]. `moments`: recorded values at some times, as of
        `services.monitor.past.Story.at`, with the pose q; the camera shows the robot at nearly all of them.
        """
        self._robot, self._colors = robot, colors
        self._model = Model(robot, World())
        self._camera = self._framed(moments, size)

    def picture(self, values: dict[str, Any]) -> Any:
        """Return the picture of the robot as a Pillow image.

        `values`: the recorded values at one time, as returned by `services.monitor.past.Story.at`, and `q`, the pose (n,) rad.
        """
        from PIL import Image, ImageDraw

        pose, scene = self._scene(values)
        picture = Image.fromarray(draw(scene, self._camera, None, RAYS, GROUND))
        self._draw_places(ImageDraw.Draw(picture), values, pose.transforms)
        return picture

    def _scene(self, values: dict[str, Any]) -> tuple[Pose, list[Solid]]:
        self._show_objects(values)
        pose = self._model.evaluate(values["q"])
        return pose, [*self._solids(pose, values), *object_solids(pose.objects)]

    def _solids(self, pose: Pose, values: dict[str, Any]) -> list[Solid]:
        agents = values.get("places", {})
        return [self._tinted(one, agents).at(pose.transforms) for one in link_solids(self._robot)]

    def _tinted(self, one: LinkSolid, agents: Mapping[str, Any]) -> LinkSolid:
        """Return a solid, mixed with the colour of the agent that moves its part; unchanged if there is none."""
        if one.part not in agents or one.part not in self._colors:
            return one
        hue = (channel / 255.0 for channel in self._colors[one.part])
        red, green, blue = ((1.0 - TINT) * own + TINT * new for own, new in zip(one.solid.color, hue, strict=True))
        return replace(one, solid=replace(one.solid, color=(red, green, blue)))

    def _framed(self, moments: Sequence[dict[str, Any]], size: tuple[int, int]) -> Camera:
        """Return the camera that sees robot, targets and places at nearly all moments, in the middle of its picture."""
        axes, (width, height) = camera_axes(FIRST_VIEW if self._robot.name in AT_TABLE else OTHER_VIEW), size
        boxes = []  # left, bottom, right, top [m]
        for values in moments:
            pose, scene = self._scene(values)
            points = [np.empty((0, 3)), *(moved(pose.transforms, where) for where in values.get("places", {}).values())]
            seen = framing(axes, focus(scene), np.vstack(points), height, MARGIN)
            left, top = seen.corner.tolist()
            boxes.append((left, top - seen.height / seen.scale, left + seen.width / seen.scale, top))
        low, high = np.quantile(boxes, USUAL, axis=0)[:2], np.quantile(boxes, 1.0 - USUAL, axis=0)[2:]
        scale = float((np.array([width, height - HEADING]) / (high - low)).min())
        corner = 0.5 * (low + high) + 0.5 * np.array([-width, height + HEADING]) / scale
        return Camera(axes, corner, scale, width, height)

    def _show_objects(self, values: dict[str, Any]) -> None:
        world = self._model.world
        for name in list(world.objects):
            world.remove(name)
        for one in values.get("objects", []):
            shape = Geometry(one["kind"], tuple(one["size"]))
            world.add(one["name"], shape, position=one["position"], rotation=one["rotation"], role=one["role"])

    def _draw_places(self, ink: Any, values: dict[str, Any], transforms: Array) -> None:
        for part, where in values.get("places", {}).items():
            plan = values.get("left", {}).get(part)
            if plan is None:
                continue
            pixels, hue = [(x, y) for x, y in self._camera.pixels(moved(transforms, where)).tolist()], self._colors[part]
            for state in np.argsort(plan["left"]).tolist():
                share = plan["left"][state]
                dot(ink, pixels[state], 1.6 + 1.8 * share, mixed(LEARNED, hue, share), mixed(GROUND, hue, 0.3 + 0.3 * share))
            path = [pixels[state] for state in (plan["here"], *plan["path"])]
            for start, end in list(pairwise(path))[1:]:
                ink.line([start, end], fill=hue, width=1)
            if len(path) > 1:
                ink.line(path[:2], fill=WHITE, width=2)
                dot(ink, path[1], 4.5, hue, WHITE, 2)
            dot(ink, path[0], 3.5, None, TEXT, 2)


def moved(transforms: Array, where: dict[str, Any]) -> Array:
    """Return points that are fixed to a link, (N, 3) m, in the root frame.

    `transforms`: poses of all links in the root frame, (L, 4, 4). `where`: {"link": index of the link, "points": (N, 3) m in its frame}.
    """
    link, points = transforms[where["link"]], np.array(where["points"])
    found: Array = points @ link[:3, :3].T + link[:3, 3]
    return found
