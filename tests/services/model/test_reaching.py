# SPDX-License-Identifier: Apache-2.0
"""While a part reaches, its link has no contacts with the targets, and the controller gets their positions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import Reach, Targets
from bus_schema.rpc import AddObject, Done, MoveObject, OneName
from mobee.reach import TARGET
from services.common.bus import Publisher
from services.common.rpc import CallFailed
from tests.services.harness import wait_for
from tests.services.model.stage import BALL, UPRIGHT, Stage, library


@dataclass
class Reacher:
    """A client that places a target at the left palm, and publishes reaches as the controller does."""

    stage: Stage
    at: list[float]
    targets: list[Targets]
    instance: str = "n1"
    streams: dict[str, Publisher[Any]] = field(default_factory=dict)

    def present(self, who: str = "agent_left_arm", position: list[float] | None = None) -> None:
        fields = {"name": TARGET, "geometry": BALL, "position": position or self.at, "quaternion": UPRIGHT, "role": "target"}
        self.stage.rig.call(keys.world_rpc("add"), AddObject, Done, who=who, **fields)

    def tell(self, phase: str, part: str = "left_arm", marker: str = "left_palm") -> None:
        bus = self.stage.rig.bus
        stream = self.streams.setdefault(part, bus.publisher(Reach, part))
        q = [0.0] * bus.part_sizes[part]
        both = {"action_id": "a", "marker": marker, "object": TARGET, "end_k": bus.k, "target": self.at, "position": self.at}
        stream.put(phase=phase, q=q, missing=0.0, settled=False, touched=[], **both)

    def touches_target(self) -> bool:
        """By the hand, with the fields that the palm is inside."""
        self.stage.tick()
        touching = {contact.first for contact in self.stage.contacts[-1].contacts if contact.second == TARGET}
        assert ("l_forearm_field" in touching) == ("l_palm_field" in touching)
        return "l_palm_field" in touching

    def hears_at(self, k: int) -> None:
        self.stage.wait_for_answer(self.targets, k)

    def wait_for_contact(self, expected: bool) -> None:
        wait_for(lambda: self.touches_target() == expected, f"contact: {expected}")


@pytest.fixture
def reacher(run: Stage) -> Iterator[Reacher]:
    at = library().evaluate(run.rig.robot.home).position("left_palm").tolist()
    made = Reacher(run, at, run.rig.record(Targets))
    run.rig.token("agent_left_arm", made.instance)
    yield made
    if run.rig.holds("agent_left_arm", made.instance):
        run.rig.drop_token("agent_left_arm", made.instance)
    wait_for(lambda: TARGET not in run.world(), "the target to be taken away")


def test_the_target_does_not_repel_the_hand_while_it_reaches(reacher: Reacher) -> None:
    reacher.present()
    assert reacher.touches_target()
    reacher.tell("reaching")
    reacher.wait_for_contact(expected=False)
    reacher.tell("returning")
    reacher.wait_for_contact(expected=True)
    reacher.tell("reaching", "right_arm", "right_palm")
    wait_for(lambda: reacher.targets, "the reach to be known")
    assert reacher.touches_target()
    reacher.tell("over", "right_arm", "right_palm")


def test_the_position_of_the_target_is_published_in_every_tick_of_a_reach(reacher: Reacher) -> None:
    reacher.present()
    reacher.stage.tick()
    assert reacher.targets == []
    reacher.tell("reaching")
    reacher.wait_for_contact(expected=False)
    k = reacher.stage.tick().re_k
    reacher.hears_at(k)
    assert reacher.targets[-1].positions == {TARGET: reacher.at}
    there = [-0.3, 0.2, 0.1]
    reacher.stage.edit("move", MoveObject, name=TARGET, position=there)
    k = reacher.stage.tick().re_k
    reacher.hears_at(k)
    assert (reacher.targets[-1].positions, reacher.targets[-1].gone) == ({TARGET: there}, [])
    reacher.stage.edit("remove", OneName, name=TARGET)
    k = reacher.stage.tick().re_k
    reacher.hears_at(k)
    assert (reacher.targets[-1].positions, reacher.targets[-1].gone) == ({}, [TARGET])
    reacher.tell("over")


def test_a_reach_ends_with_the_controller_and_with_the_run(reacher: Reacher) -> None:
    rig = reacher.stage.rig
    rig.token("controller", "c1")
    reacher.present()
    reacher.tell("reaching")
    reacher.wait_for_contact(expected=False)
    rig.drop_token("controller", "c1")
    reacher.wait_for_contact(expected=True)
    reacher.tell("reaching")
    reacher.wait_for_contact(expected=False)
    reacher.stage.sim.new_run()
    assert reacher.touches_target()


def test_the_target_is_removed_when_the_service_that_presented_it_has_ended(reacher: Reacher) -> None:
    reacher.present()
    reacher.stage.rig.drop_token("agent_left_arm", reacher.instance)
    wait_for(lambda: TARGET not in reacher.stage.world(), "the target to be taken away")


def test_a_second_service_that_presents_a_target_is_refused(reacher: Reacher) -> None:
    reacher.present()
    with pytest.raises(CallFailed, match="^agent_left_arm presents .* agent_right_arm can after agent_left_arm has ended") as caught:
        reacher.present("agent_right_arm")
    assert caught.value.code == "owned"
    reacher.present(position=[-0.3, 0.2, 0.1])
    np.testing.assert_allclose(reacher.stage.world()[TARGET].position, [-0.3, 0.2, 0.1])


def test_a_reach_with_an_unknown_marker_is_refused_and_counted(reacher: Reacher) -> None:
    reacher.present()
    before = reacher.stage.rig.stat("model").rejected.get("value", 0)
    reacher.tell("reaching", marker="left_plam")
    wait_for(lambda: reacher.stage.rig.stat("model").rejected.get("value", 0) == before + 1, "the refusal")
    assert reacher.touches_target()
