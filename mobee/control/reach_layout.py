"""Where the numbers of reaches stand, a row of each array for each reach.  This file imports nothing: what is compiled depends on it."""

from __future__ import annotations

# Integers, (reaches, WHOLE).  Of the part: the first motor, and the one after the last.  Moved: how many motors are pulled.  Joints:
# how many there are between the base and the marker.  Used: up to the last of them that a pulled motor drives.
FIRST, STOP, MOVED, JOINTS, USED, SURFACE, TURNED = range(7)
WHOLE = 7

# Floats, (reaches, REAL).  Where the marker is to be, how near, where its normal is to point; both in the link's frame.
TARGET, RADIUS, WANTED, POINT, NORMAL = 0, 3, 4, 7, 10
# Of the last tick: marker and normal, root frame; what is missing, toward the target, in m (6,), and its length [m].
AT, FACING, ERROR, MISSING = 13, 16, 19, 25
# What the default law remembers: what is missing without the encoders' noise (6,), whether it has begun to, the least so far [m] and
# for how long [s], and what is left [m].
SEEN, BEGUN, BEST, SINCE, LEFT = 26, 32, 33, 34, 35
# Its working space: J E J^T and what is made of it (6, 6) each, the force on the marker (6,), and where a wall pushes it (6,).
GIVE, SOLVED, PUSH, AWAY = 36, 72, 108, 114
REAL = 120

# The joints between base and marker, integers (reaches, joints, 2 + drives): whether it slides, whether a motor that is pulled drives
# it, and the motors that do.
SLIDES, PULLED, DRIVEN_BY = range(3)
# Floats (reaches, joints, LINK + 2 drives): the line it turns about, at zero pose, and its angle at home.  Of the last tick: angle, sine,
# cosine, the marker in the frame of what carries the joint (3,), and that frame (9,), row by row; how the joint moves the marker and turns
# it (6,), root frame.  Then how much each motor drives it; and again, 0 for motors that are not pulled.
AXIS, PIVOT, OFFSET, ANGLE, SINE, COSINE, SEEN_FROM, FRAME, MOTION = 0, 3, 6, 7, 8, 9, 10, 13, 22
LINK = 28

# Floats (reaches, ROWS + moved, n): the marker's Jacobian of the last tick (6,), each motor in its UNIT, 0 if not pulled; J^T error; how
# much each motor gives way; the force; the way out of a singular pose, and the one before; the way along which the path bends most; which
# of those pulled it is; how strongly its limit holds it back, and what else does; and a matrix (moved, n): how J^T of the error, or of
# the force, changes with each motor.
COLUMN, SLOPE, EASE, FORCE, WAY, BEFORE, BENT, SPARE, LIMITED, HELD, CURVE = 0, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
ROWS = 15
