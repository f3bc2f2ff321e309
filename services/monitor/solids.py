"""A robot without meshes on the live page: its solids, each drawn once in the frame of its link."""

from __future__ import annotations

import rerun as rr

from mobee.kinematics.quaternion import from_matrix
from mobee.robot.robot import Array, Robot
from services.monitor import palette
from services.monitor.blueprint import ROOT
from services.monitor.volumes import drawn


class Solids:
    """Logs to a stream under robot/: what moves is one transform a link that has solids."""

    def __init__(self, stream: rr.RecordingStream, robot: Robot) -> None:
        self._stream = stream
        colors = {part: palette.SOLIDS[k % len(palette.SOLIDS)] for k, part in enumerate(robot.parts)}
        solids = [shape for shape in robot.shapes if shape.role == "solid"]
        self._frames = {shape.link: f"link_{shape.link}" for shape in solids}
        for shape in solids:
            color = (*colors.get(shape.part, palette.SOLIDS[0]), 255)
            body = drawn(shape.kind, shape.size, shape.position, shape.rotation, color, shape.vertices)
            path = rr.new_entity_path(["robot", "solids", robot.links[shape.link], shape.name])
            stream.log(path, rr.CoordinateFrame(self._frames[shape.link]), body, static=True)

    def move(self, transforms: Array) -> None:
        """The links as they are now; `transforms`: (L, 4, 4), from link_transforms."""
        turns = from_matrix(transforms[:, :3, :3])[:, [1, 2, 3, 0]]
        for link, frame in self._frames.items():
            place = rr.Transform3D(
                translation=transforms[link, :3, 3], quaternion=rr.Quaternion(xyzw=turns[link]), parent_frame=ROOT, child_frame=frame
            )
            self._stream.log(f"robot/frames/{frame}", place)
