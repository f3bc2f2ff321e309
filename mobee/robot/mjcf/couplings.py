# SPDX-License-Identifier: Apache-2.0
"""Finds the joints of an MJCF model that move together, by joint equalities and by driven tendons; each group has one motor."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from mobee.robot.mjcf.compiled import Compiled
from mobee.robot.urdf.motors import LEAST, Drive

Line = tuple[int, int, float, float]  # joint one = scale * joint other + offset


def drives_of(compiled: Compiled) -> dict[int, Drive]:
    """Return the drive (motor, scale and offset) of each hinge and slide that moves; the keys are MuJoCo's numbers of these joints.

    A joint equality couples its two joints. An actuator of a fixed tendon moves the joints of the tendon together, in proportion to their
    coefficients, unless one of these joints has its own actuator. A group of coupled joints has one motor. Its name is that of the joint in
    the group that has an actuator; if none has one, that of the joint that does not depend on another. Joints that an equality holds at a
    constant position have no drive.
    """
    held = held_joints(compiled)
    moving = [j for j, kind in enumerate(compiled.joint_kinds) if kind in ("hinge", "slide") and j not in held]
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


def held_joints(compiled: Compiled) -> set[int]:
    """Return MuJoCo's numbers of the joints that an equality with a single joint fixes.

    In `compiled`, the frames of the bodies belong to the pose with these joints at their fixed positions.
    """
    model = compiled.model
    return {int(model.eq_obj1id[k]) for k in _active(compiled, "joint") if model.eq_obj2id[k] < 0}


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
