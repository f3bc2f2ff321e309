# SPDX-License-Identifier: Apache-2.0
"""The example of an own robot_sim, which a call on `break/{fault}` breaks in one place; `break/none` mends it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

import msgspec
import numpy as np
import zenoh

from services.common.config import load_config
from services.common.entry import robot_of
from services.common.service import Service
from services.robot_sim import gate as gates
from services.robot_sim.gate import Gate
from services.robot_sim.guard import Guard

sys.path.insert(0, str(Path(__file__).parents[3] / "examples" / "bus"))
import own_robot  # noqa: E402


def published(own: Any, change: Callable[[dict[str, Any]], dict[str, Any]]) -> Any:
    put = own.sensors._tick.put
    return patch.object(own.sensors._tick, "put", lambda **fields: put(**change(fields)))


def meta(own: Any, change: Callable[[Any], Any]) -> Any:
    made = own_robot.part_meta
    return patch.object(own_robot, "part_meta", lambda robot, part: change(made(robot, part)))


def without(fields: dict[str, Any], name: str) -> dict[str, Any]:
    return {**fields, "parts": {part: status for part, status in fields["parts"].items() if part != name}}


def every_second(own: Any) -> Any:
    publish = own.sensors.publish
    return patch.object(own.sensors, "publish", lambda *given: own.service.bus.k % 2 and publish(*given))


def admits(**changed: Callable[[Any, Any, int], Any]) -> Callable[[Any], Any]:
    """An order is changed before the gate checks it, so that one rule cannot refuse it."""
    admit = Gate.admit

    def lax(gate: Gate, order: Any, k: int, now: int, q: Any) -> None:
        fields = {name: change(gate, order, k) for name, change in changed.items()}
        admit(gate, msgspec.structs.replace(order, **fields), k, now, q)

    return lambda own: patch.object(Gate, "admit", lax)


def any_step(own: Any) -> Any:
    return patch.object(gates.Admission, "check_step", lambda *given: None)


def any_number(own: Any) -> Any:
    return patch.object(gates.Admission, "_is_within", lambda *given: True)


def eager(own: Any) -> Any:
    admit = Gate.admit

    def at_once(gate: Gate, order: Any, k: int, now: int, q: Any) -> None:
        gate.state = "armed"
        admit(gate, order, k, now, q)

    return patch.object(Gate, "admit", at_once)


def endless(own: Any) -> Any:
    return patch.object(Gate, "_has_expired", lambda *given: False)


def same_epoch(own: Any) -> Any:
    take = Gate.take

    def again(gate: Gate, who: str, instance: str) -> int:
        gate.epoch -= 1
        return take(gate, who, instance)

    return patch.object(Gate, "take", again)


def turned(own: Any) -> Any:
    command = own.motors.command
    return patch.object(own.motors, "command", lambda part, mode, ref: command(part, mode, -ref if mode == "velocity" else ref))


def half_mindless(own: Any) -> Any:
    """Only the first part holds."""
    return patch.object(Guard, "hold_all", lambda guard, why: next(iter(guard.gates.values())).force_hold(why))


def nothing(place: Any, name: str) -> Callable[[Any], Any]:
    return lambda own: patch.object(place, name, lambda *given: None)


FAULTS: dict[str, Callable[[Any], Any]] = {
    "slow": lambda own: published(own, lambda fields: {**fields, "rate": 3.0}),
    "gaps": every_second,
    "degrees": lambda own: published(own, lambda fields: {**fields, "q": np.rad2deg(fields["q"]).tolist()}),
    "nan": lambda own: published(own, lambda fields: {**fields, "q": [float("nan")] * len(fields["q"])}),
    "short": lambda own: published(own, lambda fields: {**fields, "q": fields["q"][1:]}),
    "part": lambda own: published(own, lambda fields: without(fields, "torso")),
    "order": lambda own: meta(own, lambda made: msgspec.structs.replace(made, motors=made.motors[::-1])),
    "limits": lambda own: meta(own, lambda made: msgspec.structs.replace(made, upper=[2.0 * upper for upper in made.upper])),
    "deaf": lambda own: patch.object(own.motors, "command", lambda *given: None),
    "turned": turned,
    "eager": eager,
    "epoch": admits(epoch=lambda gate, order, k: gate.epoch),
    "seq": admits(seq=lambda gate, order, k: max(order.seq, gate._newest_seq + 1)),
    "age": admits(re_k=lambda gate, order, k: max(order.re_k, k)),
    "future": admits(re_k=lambda gate, order, k: min(order.re_k, k)),
    "step": any_step,
    "number": any_number,
    "endless": endless,
    "same_epoch": same_epoch,
    "orphan": nothing(Gate, "lose_owner"),
    "mindless": nothing(Guard, "hold_all"),
    "half_mindless": half_mindless,
    "unstoppable": nothing(Guard, "_stop_all"),
    "silent_stop": nothing(Guard, "_repeat_stop"),
}


def main() -> None:
    config = load_config(own_robot.Config, None, "broken_robot")
    with Service("robot_sim", config, robot := robot_of(config), prompt=True) as service, ExitStack() as broken:
        own = own_robot.OwnRobot(service, config, robot)

        def choose(query: zenoh.Query) -> None:
            fault = str(query.key_expr).rpartition("/")[2]

            def apply() -> None:
                broken.close()
                if fault != "none":
                    broken.enter_context(FAULTS[fault](own))
                with query:
                    query.reply(query.key_expr, b"")

            service.inbox.put(apply)

        kept = service.bus.session.declare_queryable("break/*", choose)
        service.ready()
        own.run()
        del kept


if __name__ == "__main__":
    main()
