# SPDX-License-Identifier: Apache-2.0
"""Reads the motors of an MJCF model: limits, home, torque, and the joints that each of them drives.

Joints that move together, by joint equalities and by driven tendons, have one motor.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.robot.mjcf.compiled import Compiled
from mobee.robot.motor_units import angle_unit, outside_zones
from mobee.robot.robot import Motor
from mobee.robot.urdf.motors import LEAST, SLIDE, TURN, Drive
from mobee.robot.urdf.srdf import HOMES, ZERO
from mobee.robot.urdf.tree import FARTHEST

NARROWEST = 1e-6  # rad or m: couplings that leave a motor less are not used to limit it
Line = tuple[int, int, float, float]  # joint one = scale * joint other + offset


def joint_limits(compiled: Compiled, joint: int) -> Array:
    """Return the lower and upper limit (2,) of a joint, rad or m; without limits: -pi to pi, or -1 to 1 m for a slide.

    A limit beyond 1e6 counts as infinite; the joint then has the same interval, from its other limit if that is finite. `joint`: MuJoCo's
    number of the joint.
    """
    low, high = compiled.model.jnt_range[joint].tolist() if compiled.model.jnt_limited[joint] else (-np.inf, np.inf)
    span = SLIDE if compiled.joint_kinds[joint] == "slide" else TURN
    if low < -FARTHEST and high > FARTHEST:
        return np.array([-span / 2.0, span / 2.0])
    return np.array([low if low >= -FARTHEST else high - span, high if high <= FARTHEST else low + span])


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
    """Return the largest torque [N m], or force [N], that the actuators of the joints are given; 0 if the file gives none, or inf."""
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
    return largest if np.isfinite(largest) else 0.0


def drives_of(compiled: Compiled) -> dict[int, Drive]:
    """Return the drive (motor, scale and offset) of each hinge and slide that moves; the keys are MuJoCo's numbers of these joints.

    A joint equality couples its two joints. An actuator of a fixed tendon moves the joints of the tendon together, in proportion to their
    coefficients, unless one of these joints has its own actuator. A group of coupled joints has one motor. Its name is that of the joint in
    the group that has an actuator; if none has one, that of the joint that does not depend on another. Joints that an equality holds at a
    constant position have no drive.
    """
    moving = [j for j, kind in enumerate(compiled.joint_kinds) if kind in ("hinge", "slide") and j not in compiled.held]
    links: dict[int, list[Line]] = defaultdict(list)
    slaves: set[int] = set()
    for one, other, scale, offset in (*_equalities(compiled), *_tendons(compiled)):
        if one in moving and other in moving:
            links[other].append((one, other, scale, offset))
            links[one].append((other, one, 1.0 / scale, -offset / scale))
            slaves.add(one)
    driven = actuated(compiled)
    order = sorted(moving, key=lambda joint: (joint not in driven, joint in slaves, joint))
    drives: dict[int, Drive] = {}
    for joint in order:
        if joint in drives:
            continue
        master = compiled.names["joint"][joint]
        drives[joint] = Drive(master, 1.0, 0.0)
        waiting = [joint]
        while waiting:
            known = waiting.pop()
            for one, _, scale, offset in links[known]:
                if one not in drives:
                    drives[one] = Drive(master, scale * drives[known].scale, scale * drives[known].offset + offset)
                    waiting.append(one)
    return drives


def actuated(compiled: Compiled) -> dict[int, list[int]]:
    """Return the joints that an actuator drives directly (transmission `joint` or `jointinparent`).

    Keys: MuJoCo's number of the joint. Values: MuJoCo's numbers of these actuators.
    """
    found: dict[int, list[int]] = defaultdict(list)
    for actuator, kind in enumerate(compiled.transmissions):
        if kind in ("joint", "jointinparent"):
            found[int(compiled.model.actuator_trnid[actuator, 0])].append(actuator)
    return found


def loops(compiled: Compiled) -> list[str]:
    """Return a description of each unsupported coupling: of constraints that close a loop, and of couplings that are not linear."""
    names, model = compiled.names["equality"], compiled.model
    closed = [f"{compiled.equality_kinds[k]} {names[k]!r}" for kind in ("connect", "weld", "tendon") for k in _active(compiled, kind)]
    bent = [f"joint {names[k]!r} (only its linear part counts)" for k in _active(compiled, "joint") if model.eq_data[k, 2:5].any()]
    return closed + bent


def _active(compiled: Compiled, kind: str) -> list[int]:
    return [k for k, one in enumerate(compiled.equality_kinds) if one == kind and compiled.model.eq_active0[k]]


def _equalities(compiled: Compiled) -> Iterator[Line]:
    """Yield the couplings of joint equalities: q1 - r1 = c0 + c1 (q2 - r2), with the reference positions r."""
    model = compiled.model
    for k in _active(compiled, "joint"):
        one, other = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        if other < 0 or abs(model.eq_data[k, 1]) < LEAST:
            continue
        shift, scale = map(float, model.eq_data[k, :2])
        rest = model.qpos0[model.jnt_qposadr[[one, other]]]
        yield one, other, scale, float(rest[0] + shift - scale * rest[1])


def _tendons(compiled: Compiled) -> Iterator[Line]:
    """Yield the couplings of fixed tendons that an actuator drives: each joint goes in proportion to its coefficient."""
    model, own = compiled.model, actuated(compiled)
    driven = [int(model.actuator_trnid[k, 0]) for k, kind in enumerate(compiled.transmissions) if kind == "tendon"]
    for tendon in dict.fromkeys(driven):
        start = int(model.tendon_adr[tendon])
        wraps = range(start, start + int(model.tendon_num[tendon]))
        if any(compiled.wraps[k] != "joint" for k in wraps):
            continue
        joints, shares = model.wrap_objid[list(wraps)].tolist(), model.wrap_prm[list(wraps)].tolist()
        if np.abs(shares).min() < LEAST or any(joint in own for joint in joints):
            continue
        for joint, share in zip(joints[1:], shares[1:], strict=True):
            yield joint, joints[0], share / shares[0], 0.0
