"""From where a picture is taken: parallel rays, so that lengths are the same near and far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from experiments.drawing.solid import Solid
from mobee.arrays import Array
from mobee.errors import UnknownName

# Azimuth and elevation of the camera, degrees: 0 is in front of a robot that looks along -x as the iCub does, 90 at its right.
VIEWS = {
    "front": (0.0, 8.0),
    "side": (90.0, 8.0),
    "oblique": (40.0, 25.0),
    "left": (-40.0, 25.0),
    "top": (0.0, 89.0),
    "behind": (140.0, 25.0),
}
MARGIN = 0.03  # m


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A picture of width x height pixels, of `scale` pixels a metre.

    `axes` (3, 3): rows are what is right, up and ahead of the camera, in the root frame.  `corner`: right and up [m] of the picture's upper
    left corner.
    """

    axes: Array
    corner: Array
    scale: float
    width: int
    height: int

    def finer(self, times: int) -> Camera:
        """The same picture with that many times the pixels in both directions."""
        return replace(self, scale=self.scale * times, width=self.width * times, height=self.height * times)

    def pixels(self, points: Array) -> Array:
        """Where points (..., 3) m are in the picture: column and row, counted from its corner, (..., 2)."""
        flat = points @ self.axes[:2].T - self.corner
        return self.scale * flat * np.array([1.0, -1.0])


def axes_of(azimuth: float, elevation: float) -> Array:
    """What is right, up and ahead of a camera there [degrees], (3, 3)."""
    a, e = np.deg2rad([azimuth, elevation])
    ahead = np.array([np.cos(a) * np.cos(e), -np.sin(a) * np.cos(e), -np.sin(e)])
    right = np.array([-np.sin(a), -np.cos(a), 0.0])
    return np.array([right, np.cross(right, ahead), ahead])


def axes_named(view: str | tuple[float, float]) -> Array:
    """Those of a view by name, or of azimuth and elevation [degrees]; raises UnknownName."""
    if isinstance(view, str):
        if view not in VIEWS:
            raise UnknownName("view", view, VIEWS)
        view = VIEWS[view]
    return axes_of(*view)


def framing(axes: Array, solids: Sequence[Solid], points: Array, height: int, margin: float = MARGIN) -> Camera:
    """The camera whose picture, that many pixels high, just holds the solids and the points (P, 3) m with a margin [m] around them."""
    seen = [points @ axes[:2].T] if len(points) else []
    for sign in (1.0, -1.0):
        if solids:
            seen.append(np.array([[solid.position @ axis + sign * solid.reach(sign * axis) for axis in axes[:2]] for solid in solids]))
    low, high = np.min([flat.min(axis=0) for flat in seen], axis=0) - margin, np.max([flat.max(axis=0) for flat in seen], axis=0) + margin
    scale = height / float(high[1] - low[1])
    return Camera(axes, np.array([low[0], high[1]]), scale, max(1, int(np.ceil(scale * (high[0] - low[0])))), height)
