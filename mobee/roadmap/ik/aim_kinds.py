"""The kinds of aims of least squares, numbered as in core/aims.hpp."""

from __future__ import annotations

# PLACE: the two points are one.  TURNED: the two frames are parallel.  ALONG: the two directions are one.  HOLD: the points are a length
# apart.  FACING: the first direction points to the second point.  COORDINATE: the first point is a length further than the second in a
# direction of the root frame, the first three numbers of the second frame, of any length itself.  AT_MOST: no further than
# that.  MOTOR: a motor is at a value, the length.
KINDS = PLACE, TURNED, ALONG, HOLD, FACING, COORDINATE, AT_MOST, MOTOR = tuple(range(8))
