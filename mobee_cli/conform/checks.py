# SPDX-License-Identifier: Apache-2.0
"""The rules of the bus contract that every robot_sim must keep, each with a check (docs/hardware.md).

A check is a function of a player, which acts as the controller, and of the part that is tested. It raises Broken if the rule is not kept.
The process that takes a part is its owner. The part is then in hold: it stands still. When the owner has armed it, the part follows the
owner's commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import EStop, Mode, Order, State
from bus_schema.rpc import Config, Done, Empty, PartMeta, Pulse
from mobee.arrays import Array
from mobee.robot.motor_units import fine_units, motor_units, unit_name
from mobee_cli.conform.player import ANSWER, TTL, Broken, Player
from services.common.rpc import CallFailed
from services.common.worlds import robot_hash
from services.robot_sim.sensors import part_meta

OBSERVED = 1.5  # s for which the streams are recorded
MISSING = 0.1  # share of the ticks that may not arrive
SLOWEST, FASTEST = 0.5, 1.1  # of the rate that dt claims: a busy machine is slow, nothing is fast
# For a motor that slides, these numbers count as angles: 1 rad is the unit of its motor_units (SPEED, JUMP) or of its fine_units (others).
OUTSIDE = math.radians(5.0)  # rad beyond its limits at which a position cannot be right
SPEED = 0.1  # rad/s, at which a motor is moved
MOTION = 0.4  # s for which it is moved
LEAST = 0.25  # share of the commanded motion that must be seen: servos lag
STILL = math.radians(1.0)  # rad by which a part that must not move may seem to, by noise
JUMP = 0.1  # rad, of a position command that must be refused
ATTEMPTS = 5  # to bring a valid command into force
NONE = -1  # cmd_seq without a command in force
STOP_TIME = 0.5  # s within which a stop is obeyed


@dataclass(frozen=True, slots=True)
class Check:
    """The check of one rule of the contract, which every robot_sim must keep.

    `name`: name of the check. `rule`: the requirement, as text. `test`: function that tests the rule with a part of the robot, and raises
    Broken if the robot breaks it. `moves`: whether the test arms the part; an armed part follows commands, so that it may move.
    """

    name: str
    rule: str
    test: Callable[[Player, str], None]
    moves: bool = False


def service(player: Player, part: str) -> None:
    """Test that robot_sim has a liveliness token and answers the calls of every service (stat, config, pulse); raises Broken otherwise.

    `part`: not used.
    """
    if not player.service.alive.get("robot_sim"):
        raise Broken("there is no liveliness token alive/robot_sim/INSTANCE: declare it after all subscriptions and calls")
    if len(player.service.alive["robot_sim"]) > 1:
        raise Broken(f"{len(player.service.alive['robot_sim'])} processes have the token of robot_sim: end all but one")
    stat = player.stat()
    if stat.who != "robot_sim" or not stat.ready:
        raise Broken(f"stat says who {stat.who!r}, ready {stat.ready}: expected 'robot_sim', True")
    player.call_as_operator(keys.service_rpc("robot_sim", "config"), Empty, Config)
    player.call_as_operator(keys.service_rpc("robot_sim", "pulse"), Empty, Pulse)


def parts(player: Player, part: str) -> None:
    """Test that the parts, their motors, the limits and the robot's hash are those of the robot file; raises Broken otherwise."""
    robot = player.robot
    if set(player.tick.parts) != set(robot.parts):
        raise Broken(f"a tick has the parts {', '.join(player.tick.parts)}; the robot file has {', '.join(robot.parts)}")
    for name, own in robot.parts.items():
        meta = player.call(keys.meta(name), Empty, PartMeta)
        if tuple(meta.motors) != own.motors:
            raise Broken(f"{name}/meta has the motors {', '.join(meta.motors)}; in the robot file their order is {', '.join(own.motors)}")
        if meta.robot_hash != robot_hash(robot):
            raise Broken(f"{name}/meta has robot_hash {meta.robot_hash}, the robot file {robot_hash(robot)}: give both the same --robot")
        _require_limits(meta, part_meta(robot, name))


def streams(player: Player, part: str) -> None:
    """Test that the tick, the clock and the states of all parts arrive and are valid messages; raises Broken otherwise."""
    player.until(lambda: bool(player.ticks and player.clocks and all(player.states.values())), ANSWER)
    if player.refused:
        raise Broken(f"{len(player.refused)} messages are not valid, such as {player.refused[-1]}")
    silent = [State.stream.key(name) for name, states in player.states.items() if not states]
    silent += [] if player.clocks else ["clock"]
    if not player.tick or silent:
        raise Broken(f"nothing arrives on {', '.join(silent)}")


def ticks(player: Player, part: str) -> None:
    """Test the tick messages of 1.5 s: numbers that increase, times that fit the numbers, few missing ticks, and the stated rate.

    Raises Broken if a rule is violated, for example if more than 10 % of the ticks are missing or if the run changes. `part`: not used.
    """
    first = len(player.ticks)
    player.wait(OBSERVED)
    seen = player.ticks[first:]
    if len(seen) < 2:
        raise Broken(f"{len(seen)} ticks in {OBSERVED:g} s")
    for (_, before), (_, after) in zip(seen, seen[1:], strict=False):
        if after.run != before.run:
            raise Broken(f"the run changes from {before.run} to {after.run} without a reset")
        if after.k <= before.k or after.seq <= before.seq:
            raise Broken(f"tick {after.k} (seq {after.seq}) comes after tick {before.k} (seq {before.seq}): both must increase")
        if after.t - before.t != (after.k - before.k) * after.dt:
            raise Broken(f"t advances by {after.t - before.t} ns in {after.k - before.k} ticks of dt = {after.dt} ns")
    (begin, old), (end, new) = seen[0], seen[-1]
    missing = new.k - old.k + 1 - len(seen)
    if missing > MISSING * len(seen):
        raise Broken(f"{missing} of {new.k - old.k + 1} ticks are not published: publish every one")
    actual, claimed = (new.k - old.k) / (end - begin), new.rate * 1e9 / new.dt
    if not SLOWEST * claimed < actual < FASTEST * claimed:
        raise Broken(f"{actual:.1f} ticks come a second, and dt and rate say {claimed:.1f}")


def positions(player: Player, part: str) -> None:
    """Test that all motor positions are within the limits of the robot file; raises Broken otherwise.

    The tolerance is 5 degrees; for a motor that slides, it is some 0.6 % of its range. `part`: not used.
    """
    robot = player.robot
    low, high = robot.limits.T
    q = np.array(player.tick.q)
    beyond = np.maximum(q - high, low - q) / fine_units(robot)
    worst = int(beyond.argmax())
    if beyond[worst] > OUTSIDE:
        unit = unit_name(robot, robot.motor_table[worst])
        hint = " Are they degrees? The bus has rad." if unit == "rad" and abs(q[worst]) > math.pi else ""
        raise Broken(f"{robot.motors[worst]} is at {q[worst]:.3f}, its limits are {low[worst]:.3f} to {high[worst]:.3f} {unit}.{hint}")


def ownership(player: Player, part: str) -> None:
    """Test that the calls take, arm and release work, and that no other process can take an owned part; raises Broken otherwise.

    Also tested: every take returns a larger epoch (number of the ownership) than all before, and an older epoch is refused.
    """
    first = player.take(part)
    if player.take(part) <= first:
        raise Broken(f"take returns epoch {player.epochs[part]} after {first}: each epoch must be larger than all before")
    if _accepted(lambda: player.drive(part, "arm", first)):
        raise Broken(f"arm with the epoch {first} is accepted, although {player.epochs[part]} is in force")
    if _accepted(lambda: player.take(part, instance="i0_another")):
        raise Broken("another process can take a part whose owner's token exists: refuse it with the code 'owned'")
    with player.armed(part):
        if not player.until(lambda: player.status(part).gate == "armed", ANSWER):
            raise Broken(f"after arm the ticks have gate {player.status(part).gate!r}, expected 'armed'")
    if not player.until(lambda: player.status(part).gate == "idle", ANSWER):
        raise Broken(f"after release the ticks have gate {player.status(part).gate!r}, expected 'idle'")


def hold(player: Player, part: str) -> None:
    """Test that a part in hold, which has an owner but is not armed, does not move on commands; raises Broken otherwise."""
    player.take(part)
    start = player.q(part)
    player.keep(part, "velocity", lambda: _speed(player, part), MOTION)
    _require_still(player, part, start, "a part in hold moves on command: obey in state 'armed' only")
    if player.status(part).gate == "armed":
        raise Broken("take arms the part: it must be in 'hold' until arm is called")
    player.drive(part, "release")


def obeys(player: Player, part: str) -> None:
    """Test that a part, once it is armed, follows commands of velocities and positions; raises Broken otherwise."""
    with player.armed(part):
        start, speed = player.q(part), _speed(player, part)
        player.keep(part, "velocity", lambda: speed, MOTION)
        _require_moved(player, part, player.q(part) - start, speed * MOTION, "velocity")
        status = player.status(part)
        if status.cmd_seq < 0 or status.mode != "velocity" or not 0 < status.cmd_age < 1e3:
            raise Broken(
                f"the ticks have mode {status.mode!r}, cmd_seq {status.cmd_seq}, cmd_age {status.cmd_age} of the command in force: "
                "expected 'velocity', its seq, and the ticks since its re_k"
            )
        player.drive(part, "hold")
        player.wait(MOTION)
        player.drive(part, "arm")
        start, done = player.q(part), player.tick
        player.keep(part, "position", lambda: start - speed * (player.tick.t - done.t) * 1e-9, MOTION)
        _require_moved(player, part, player.q(part) - start, -speed * MOTION, "position")


def refuses(player: Player, part: str) -> None:
    """Test that robot_sim ignores invalid commands, such as one computed from a tick that is too old; raises Broken otherwise.

    `player`: the connection with robot_sim. `part`: part to which the commands are sent.
    """
    n = len(player.robot.part(part))
    still, nan = np.zeros(n), np.full(n, math.nan)
    limits, jump = player.robot.limits[player.robot.part(part).slice], JUMP * _units(player, part)
    fast = np.array([player.robot.motor_table[k].max_velocity for k in range(*player.robot.part(part).slice.indices(10**6))])
    with player.armed(part):
        bad: dict[str, tuple[Mode, Callable[[], Array], dict[str, Callable[[], object]]]] = {
            "of an older epoch": ("velocity", lambda: still, {"epoch": lambda: player.epochs[part] - 1}),
            "of another run": ("velocity", lambda: still, {"run": lambda: "run_of_yesterday"}),
            "that answers a tick half a second ago": ("velocity", lambda: still, {"re_k": lambda: _ticks_ago(player, 0.5)}),
            "that answers a tick of the future": ("velocity", lambda: still, {"re_k": lambda: player.tick.k + 1000}),
            "without an end (ttl 0)": ("velocity", lambda: still, {"ttl": lambda: 0}),
            "of NaN": ("velocity", lambda: nan, {}),
            "of 1.2 times the highest velocity": ("velocity", lambda: 1.2 * fast * (np.arange(n) == 0), {}),
            "that jumps by 0.1 rad": ("position", lambda: player.q(part) + jump * _toward_middle(player, part), {}),
            "beyond a limit": ("position", lambda: np.where(np.arange(n) == 0, limits[:, 1] + jump, player.q(part)), {}),
        }
        for what, (mode, ref, changed) in bad.items():
            fields = {name: value() for name, value in changed.items()}
            _require_ignored(player, part, what, partial(_send, player, part, mode, ref, fields))
        older = player.send(part, "velocity", still)
        player.send(part, "velocity", still)
        _require_ignored(player, part, "with a seq that was used before", lambda: player.send(part, "velocity", still, seq=older))


def watchdog(player: Player, part: str) -> None:
    """Test that a part goes into hold when its commands stop; raises Broken otherwise.

    In hold the part brakes and stands still. It must not move again before its owner has armed it again.
    """
    with player.armed(part):
        player.keep(part, "velocity", lambda: _speed(player, part), MOTION)
        if not player.until(lambda: player.status(part).gate == "hold", 1e-3 * TTL + STOP_TIME):
            gate = player.status(part).gate
            raise Broken(f"{STOP_TIME:g} s after the ttl ({TTL} ms) of the last command the gate is {gate!r}, not 'hold'")
        player.wait(STOP_TIME)
        start = player.q(part)
        player.keep(part, "velocity", lambda: _speed(player, part), MOTION)
        _require_still(player, part, start, "after the watchdog's hold the part moves without having been armed again")


def owner_gone(player: Player, part: str) -> None:
    """Test that a part goes into hold (stands still) when the liveliness token of its owner disappears; raises Broken otherwise."""
    _hold_without(player, [part], "controller", owner=True)


def model_gone(player: Player, part: str) -> None:
    """Test that all parts go into hold when the liveliness token of the service `model` disappears; raises Broken otherwise.

    Before that, all parts are armed, so that they follow commands: `part` is commanded to move, the others to stand still. A part in hold
    brakes and stands still.
    """
    _hold_without(player, [part, *(name for name in player.robot.parts if name != part)], "model", owner=False)


def emergency_stop(player: Player, part: str) -> None:
    """Test that an emergency stop stops all parts, and that the part cannot be armed before the stop is reset; raises Broken otherwise.

    Only an armed part follows commands.
    """
    with player.armed(part):
        player.keep(part, "velocity", lambda: _speed(player, part), MOTION)
        player.service.bus.publisher(EStop).put(set=True, source="conform", reason="test of the emergency stop")
        try:
            if not player.until(lambda: all(status.gate == "estop" for status in player.tick.parts.values()), STOP_TIME):
                moving = [name for name, status in player.tick.parts.items() if status.gate != "estop"]
                raise Broken(f"{STOP_TIME:g} s after an emergency stop {', '.join(moving)} are not in gate 'estop'")
            if not player.until(lambda: any(stop.src == "robot_sim" and stop.set for stop in player.stops), ANSWER):
                raise Broken("robot_sim does not repeat the stop on 'estop' while it is latched, for services that join late")
            player.take(part)
            if _accepted(lambda: player.drive(part, "arm")):
                raise Broken("a part can be armed during an emergency stop")
        finally:
            player.call_as_operator(keys.ESTOP_RESET, Empty, Done)
        if not player.until(lambda: player.status(part).gate in ("hold", "idle"), ANSWER):
            raise Broken(f"after {keys.ESTOP_RESET} the gate is {player.status(part).gate!r}, expected 'hold'")


CHECKS = (
    Check("service", "robot_sim is alive and answers stat, config and pulse", service),
    Check("streams", "tick, clock and the state of each part are valid messages", streams),
    Check("ticks", "ticks are numbered, dated and published at their rate", ticks),
    Check("parts", "parts, motors and limits are those of the robot file", parts),
    Check("positions", "positions are within the limits, in rad or m", positions),
    Check("ownership", "a part is taken, armed and released by its owner alone", ownership, moves=True),
    Check("hold", "a part that is not armed ignores commands", hold, moves=True),
    Check("obeys", "an armed part follows velocities and positions", obeys, moves=True),
    Check("refuses", "stale and invalid commands change nothing", refuses, moves=True),
    Check("watchdog", "without commands a part holds, and must be armed again", watchdog, moves=True),
    Check("owner-gone", "a part holds when its owner's token disappears", owner_gone, moves=True),
    Check("model-gone", "all parts hold when the model's token disappears", model_gone, moves=True),
    Check("emergency-stop", "an emergency stop stops all parts until its reset", emergency_stop, moves=True),
)


def _accepted(call: Callable[[], object]) -> bool:
    """Return whether a call that must be refused is answered; raises CallFailed if there is no answer."""
    try:
        call()
    except CallFailed as failed:
        if failed.code in ("no_answer", "bad_answer"):
            raise
        return False
    return True


def _toward_middle(player: Player, part: str) -> Array:
    """Return the direction in which the first motor of a part moves toward the middle of its range: 1 or -1; 0 for the others, (n,)."""
    middle = player.robot.limits[player.robot.part(part).slice].mean(axis=1)
    direction: Array = np.where(np.arange(len(middle)) == 0, np.where(player.q(part) < middle, 1.0, -1.0), 0.0)
    return direction


def _speed(player: Player, part: str) -> Array:
    return SPEED * _units(player, part) * _toward_middle(player, part)


def _units(player: Player, part: str) -> Array:
    """Return for each motor of the part the motion that counts as 1 rad, (n_part,) rad or m."""
    return motor_units(player.robot)[player.robot.part(part).slice]


def _ticks_ago(player: Player, seconds: float) -> int:
    return max(player.tick.k - math.ceil(seconds * 1e9 / player.tick.dt), 0)


def _require_still(player: Player, part: str, start: Array, what: str) -> None:
    moved = np.abs(player.q(part) - start)
    most = int((moved / fine_units(player.robot)[player.robot.part(part).slice]).argmax())
    if moved[most] > STILL * fine_units(player.robot)[player.robot.part(part).slice][most]:
        raise Broken(f"{what} ({player.robot.part(part).motors[most]} moved by {_distance(player, part, most, moved[most])})")


def _require_moved(player: Player, part: str, moved: Array, wanted: Array, mode: str) -> None:
    if moved[0] * np.sign(wanted[0]) < LEAST * abs(wanted[0]):
        raise Broken(
            f"by {mode} commands the first motor was to move by {_distance(player, part, 0, wanted[0])}, and it moved by "
            f"{_distance(player, part, 0, moved[0])}"
        )


def _distance(player: Player, part: str, number: int, moved: float) -> str:
    """Return a distance that a motor of the part moved, given in rad or m, as text; `number`: of the motor in the part."""
    motors = player.robot.motor_table[player.robot.part(part).slice]
    return f"{1e3 * moved:.1f} mm" if unit_name(player.robot, motors[number]) == "m" else f"{math.degrees(moved):.2f} deg"


def _send(player: Player, part: str, mode: Mode, ref: Callable[[], Array], fields: dict[str, object]) -> int:
    return player.send(part, mode, ref(), **fields)


def _follows(player: Player, part: str, seq: int) -> bool:
    return player.status(part).cmd_seq == seq


def _in_force(player: Player, part: str) -> int:
    """Bring a valid command into force, and return its seq; repeats it, since on a busy machine some commands arrive too late."""
    for _ in range(ATTEMPTS):
        valid = player.send(part, "velocity", np.zeros(len(player.robot.part(part))))
        if player.until(partial(_follows, player, part, valid), 1e-3 * TTL):
            return valid
    raise Broken(f"no valid command comes into force: the ticks have gate {player.status(part).gate!r}, and never its cmd_seq")


def _require_ignored(player: Player, part: str, what: str, send: Callable[[], int]) -> None:
    """Send an invalid command while a valid one is in force; raises Broken if it comes into force."""
    valid = _in_force(player, part)
    first = len(player.ticks)
    send()
    player.until(lambda: len(player.ticks) >= first + 5, 0.5e-3 * TTL)
    if any(tick.parts[part].cmd_seq not in (valid, NONE) for _, tick in player.ticks[first:]):
        raise Broken(f"a command {what} is obeyed")


def _hold_without(player: Player, parts: Sequence[str], who: str, owner: bool) -> None:
    """Require that armed parts hold when the token of a service disappears; the commands, which move the first part, continue.

    `owner`: whether the service is the owner of the parts.
    """
    session, instance = player.service.bus.session, f"i0_conform_{who}"
    token: Any = session.liveliness().declare_token(keys.alive(who, instance))
    try:
        player.wait(0.1)
        for part in parts:
            player.drive(part, "release", player.take(part))
            player.take(part, instance=instance if owner else "")
            player.drive(part, "arm")
        orders = {part: Order(player.epochs[part], "velocity") for part in parts}
        player.keep(parts[0], "velocity", lambda: _speed(player, parts[0]), MOTION, parts=orders)
        gates = {part: player.status(part).gate for part in parts}
    finally:
        token.undeclare()
    for part, gate in gates.items():
        if gate != "armed":
            raise Broken(f"under valid commands the gate of {part} is {gate!r}, expected 'armed'")
    player.keep(parts[0], "velocity", lambda: _speed(player, parts[0]), STOP_TIME, parts=orders)
    armed = [part for part in parts if player.status(part).gate == "armed"]
    for part in parts:
        player.take(part)
        player.drive(part, "release")
    if armed:
        raise Broken(f"{STOP_TIME:g} s after the token alive/{who}/... is gone these parts are still armed: {', '.join(armed)}")


def _require_limits(meta: PartMeta, ours: PartMeta) -> None:
    """Raise Broken if limits of a part differ from `ours`, those of the robot file, by more than a rounding error."""
    for limit in ("lower", "upper", "max_velocity", "max_acceleration", "max_torque"):
        found, expected = getattr(meta, limit), getattr(ours, limit)
        if len(found) != len(expected):
            raise Broken(f"{ours.part}/meta has {len(found)} values of {limit}, expected {len(expected)}")
        for motor, one, other in zip(ours.motors, found, expected, strict=True):
            if not math.isclose(one, other, rel_tol=1e-5, abs_tol=1e-8):
                raise Broken(f"{ours.part}/meta has {limit} {one:g} of {motor}; in the robot file it is {other:g}")
