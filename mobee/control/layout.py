"""Where the numbers of a packed law stand: two flat arrays, made once by `pack`, read by the compiled functions.

This file imports nothing: what is compiled depends on it.
"""

from __future__ import annotations

# Integers, header: counts and choices.
MOTORS, ACTIVE, FELT, CLAUSES, PARTS, PUBLISHED, MODALITY, TOUCH, DIRECTION = range(9)
# Integers, header: where the tables begin.  Active: motors that are ever moved.  Felt: motors on which forces are computed.
# Clause: the first row of each, and the end.  Row: the first entry of each, and the end.  Entry: its motor.  Part: first motor
# and the one after the last.
I_ACTIVE, I_FELT, I_CLAUSE, I_ROW, I_ENTRY, I_PART = range(9, 15)
HEADER = 15

POSITION, VELOCITY, TORQUE = range(3)  # values of MODALITY

# Floats, header: what all motors share; then a row for each motor, each row of a clause, each entry of such a row.
MAX_CONSTRAINT, CONTACT_GAIN, CONTACT_SLOPE, MAX_CONTACT = range(4)
F_MOTOR = 4
# A motor's row, in its own unit, rad or m.  Below, above: how far from its lower and upper limit the limit force begins, by which
# it grows to MAX_LIMIT over LIMIT_WIDTH.  Reach: how far its position reference may run ahead.  Unit: what 1 rad of the gains is in
# the motor's unit, 1 where it turns; fine: the same of the thresholds of the settle test.
(
    LOW,
    HIGH,
    STIFFNESS,
    MAX_SPRING,
    DAMPING,
    LIMIT_WIDTH,
    BELOW,
    ABOVE,
    MAX_LIMIT,
    CLIENT_SLOPE,
    MAX_CLIENT,
    MAX_SPEED,
    MAX_ACCELERATION,
    MAX_TORQUE,
    REACH,
    UNIT,
    FINE,
) = range(17)
MOTOR = 17
OFFSET, ZONE = 0, 1  # a clause's row: b [rad], and the value of a.q + b at which it begins to push
ROW = 2
FACTOR, NORMAL = 0, 1  # an entry: of a, and of a / |a| with each motor in its UNIT
ENTRY = 2

# The state of a law that runs, (5, n): own velocity [rad/s], acceleration [rad/s^2], velocity commanded last [rad/s], position
# reference [rad], and what is added to a torque command [N m].
OWN_VELOCITY, OWN_ACCELERATION, SENT, REFERENCE, FEEDFORWARD = range(5)
STATE = 5

# A settle test's numbers, and what it remembers: [s].
SPEED, ACCELERATION, FIRST_LOOK, INTERVAL, TIMEOUT = range(5)
BEGUN, NEXT_LOOK = range(2)
MOVING, SETTLED, TIMED_OUT = range(3)
