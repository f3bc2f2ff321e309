"""The kinds of aims of least squares, see `aims`, for those who need no compiled code."""

from __future__ import annotations

# PLACE: the two points are one.  TURNED: the two frames are parallel.  ALONG: the two directions are one.  HOLD: the points are a length
# apart.  FACING: the first direction points to the second point.
PLACE, TURNED, ALONG, HOLD, FACING = range(5)
