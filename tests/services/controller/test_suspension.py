# SPDX-License-Identifier: Apache-2.0
"""Which actions survive a hold."""

from __future__ import annotations

import numpy as np
import pytest

from bus_schema import VERSION
from bus_schema.messages import PartStatus, Tick
from mobee import Gains
from services.controller.action import Action
from services.controller.suspension import LONGEST, REASON_TIME, Suspensions


def at(t: float) -> Tick:
    header = {"v": VERSION, "run": "r", "src": "robot_sim", "seq": 0, "k": round(100 * t), "t": round(1e9 * t), "tw": 0}
    return Tick(**header, dt=10_000_000, mode="free", rate=1.0, parts={}, q=[])


def gate(state: str = "hold") -> PartStatus:
    return PartStatus(k=0, t=0, mode="hold", gate=state, faults=0, epoch=1, cmd_seq=-1, cmd_age=-1)  # type: ignore[arg-type]


def moving(target: bool = True) -> Action:
    action = Action(Gains.default().settle)
    action.start("a", 0, 0.0, np.zeros(3) if target else None)
    return action


def test_an_action_waits_for_the_model_but_not_for_ever() -> None:
    suspensions, action = Suspensions(), moving()
    assert suspensions.may_continue(action, at(1.0), gate())  # the reason is not known yet
    action.suspend(100, 1.0)
    suspensions.note_forces(at(1.03), fresh=False)
    assert suspensions.may_continue(action, at(1.5), gate())
    suspensions.note_forces(at(1.0 + LONGEST), fresh=False)
    assert suspensions.may_continue(action, at(1.0 + LONGEST), gate())
    assert not suspensions.may_continue(action, at(1.01 + LONGEST), gate())


def test_a_hold_for_another_reason_ends_the_action() -> None:
    suspensions, action = Suspensions(), moving()
    suspensions.note_forces(at(0.9), fresh=False)
    action.suspend(100, 1.0)
    assert not suspensions.may_continue(action, at(1.01 + REASON_TIME), gate())
    assert not suspensions.is_of_the_model(action, at(1.05))


@pytest.mark.parametrize("state", ["estop", "fault"])
def test_an_emergency_stop_and_a_fault_end_the_action_also_while_the_model_is_away(state: str) -> None:
    suspensions, action = Suspensions(), moving()
    suspensions.note_forces(at(1.0), fresh=False)
    assert suspensions.may_continue(action, at(1.0), gate())
    assert not suspensions.may_continue(action, at(1.0), gate(state))


def test_a_reach_and_an_action_that_has_ended_do_not_continue() -> None:
    suspensions, ended = Suspensions(), moving()
    suspensions.note_forces(at(1.0), fresh=False)
    ended.hold(100)
    assert not suspensions.may_continue(moving(target=False), at(1.0), gate())
    assert not suspensions.may_continue(ended, at(1.0), gate())


def test_an_action_whose_owner_goes_in_a_suspension_is_held() -> None:
    action = moving()
    action.suspend(100, 1.0)
    action.lose_owner(110)
    assert action.status == "held" and action.owner is None
