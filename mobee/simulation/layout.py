"""Where the numbers of the compiled motors and of the loop stand.  This file imports nothing: what is compiled depends on it."""

from __future__ import annotations

# The state of the motors, (STATE, n), SI units.  Motor side and joint side are the two sides of the play; DRAGGED is where the
# motor side pulls the joint side, REST where a hold stays, LOAD a torque from outside, LEFT the torque that leaves the delay line.
Q, VELOCITY, EFFORT, MOTOR_Q, MOTOR_V, DRAGGED, REST, REFERENCE, LOAD, LEFT = range(10)
STATE = 10

# What does not change while the substep is the same, (FIXED, n).  SHARE: of the way to a new velocity that a substep takes;
# PLAY: half of the backlash.
LOW, HIGH, MAX_VELOCITY, MAX_ACCELERATION, MAX_TORQUE, SHARE, PLAY, FRICTION = range(8)
FIXED = 8

# Integers, (WHOLE, n): the mode, whether a hold has come to rest, the delay in substeps.
MODE, RESTING, DELAY = range(3)
WHOLE = 3
POSITION, VELOCITY_MODE, TORQUE, HOLD = range(4)  # the first three as in mobee.control.layout

# A part of the loop, (PART,): first motor and the one after the last, whether it acts, and how its action ended.
FIRST, STOP, ACTING, VERDICT = range(4)
PART = 4

SERVO_GAIN = 8.0  # 1/s, position mode and a hold that has come to rest
