# SPDX-License-Identifier: Apache-2.0
"""Motors of an MJCF model: limits, home, torque and couplings."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.robot.mjcf.compiled import Compiled
from mobee.robot.mjcf.couplings import actuated
from mobee.robot.motor_units import angle_unit, outside_zones
from mobee.robot.robot import Motor
from mobee.robot.urdf.motors import SLIDE, TURN, Drive
from mobee.robot.urdf.srdf import HOMES, ZERO

NARROWEST = 1e-6  # rad or m: couplings that leave a motor less are not used to limit it


def joint_limits(compiled: Compiled, joint: int) -> Array:
    """Return the lower and upper limit (2,) of a joint, rad or m; without limits: -pi to pi, or -1 to 1 m for a slide.

    `joint`: MuJoCo's number of the joint.
    """
    if compiled.model.jnt_limited[joint]:
        stated: Array = compiled.model.jnt_range[joint].copy()
        return stated
    span = SLIDE if compiled.joint_kinds[joint] == "slide" else TURN
    return np.array([-span / 2.0, span / 2.0])


def home_pose(compiled: Compiled, asked: str | None) -> tuple[Array, int | None]:
    """Return MuJoCo's position vector qpos at home, and the number of the keyframe that contains it; None if no keyframe does.

    `asked`: name of the keyframe, or "zero" for every joint at 0. None: the keyframe whose name is in HOMES ("home", "ready", ...; the
    first name that exists is used). If there is none, but the file has exactly one keyframe, this keyframe; else MuJoCo's reference
    pose `qpos0`. Raises UnknownName if no keyframe has the name `asked`.
    """
    model, names = compiled.model, compiled.names["key"]
    lower = {name.lower(): index for index, name in enumerate(names)}
    if asked is not None and asked.lower() not in (*lower, ZERO):
        raise UnknownName(f"home ({compiled.path} has keyframes)", asked, (*names, ZERO))
    if asked is not None:
        chosen = lower.get(asked.lower())
        return (np.zeros(model.nq), None) if chosen is None else (model.key_qpos[chosen].copy(), chosen)
    known = next((lower[name] for name in HOMES if name in lower), 0 if len(names) == 1 else None)
    return (model.qpos0.copy(), None) if known is None else (model.key_qpos[known].copy(), known)


def read_motor(compiled: Compiled, group: list[tuple[int, int, Drive]], home: Array, meant: bool) -> Motor:
    """Return the motor that drives a group of coupled joints.

    `group`: for each joint a tuple (index in the robot, MuJoCo's number, drive); the motor has the name of the first joint. `home`:
    MuJoCo's position vector qpos at home. A limit zone is a range near a limit in which the control law pushes inward. `meant`: whether
    home is from a keyframe. True: the position at home is used even if it is in a limit zone. False: it is replaced by the nearest position
    outside the zones.
    """
    _, master, _ = group[0]
    limits = joint_limits(compiled, master)
    for _, joint, drive in group[1:]:
        if compiled.model.jnt_limited[joint]:
            ends = np.sort((joint_limits(compiled, joint) - drive.offset) / drive.scale)
            narrowed = np.array([max(limits[0], ends[0]), min(limits[1], ends[1])])
            limits = narrowed if narrowed[1] - narrowed[0] > NARROWEST else limits
    sliding = all(compiled.joint_kinds[joint] == "slide" for _, joint, _ in group)
    place = float(np.clip(home[compiled.model.jnt_qposadr[master]], *limits))
    torque = _torque(compiled, [joint for _, joint, _ in group])
    return Motor(
        name=compiled.names["joint"][master],
        part="all",
        limits=limits,
        home=place if meant else outside_zones(place, limits, angle_unit(limits, sliding)),
        joints=tuple((index, drive.scale, drive.offset) for index, _, drive in group),
        zone_ends_at_home=True,
        **({"max_torque": torque} if torque else {}),
    )


def _torque(compiled: Compiled, joints: list[int]) -> float:
    """Return the largest torque [N m], or force [N], that the actuators of the joints are given; 0 where the file gives none."""
    model, own = compiled.model, actuated(compiled)
    largest = 0.0
    for joint in joints:
        if model.jnt_actfrclimited[joint]:
            largest = max(largest, float(np.abs(model.jnt_actfrcrange[joint]).max()))
            continue
        for actuator in own.get(joint, ()):
            gear = abs(float(model.actuator_gear[actuator, 0]))
            if model.actuator_forcelimited[actuator]:
                largest = max(largest, gear * float(np.abs(model.actuator_forcerange[actuator]).max()))
            elif model.actuator_ctrllimited[actuator] and not model.actuator_biasprm[actuator].any():  # a motor: force = gain * control
                gain = abs(float(model.actuator_gainprm[actuator, 0]))
                largest = max(largest, gear * gain * float(np.abs(model.actuator_ctrlrange[actuator]).max()))
    return largest
