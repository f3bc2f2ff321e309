# SPDX-License-Identifier: Apache-2.0
"""What identities may do: under their own name only, and nothing that the table does not give to their party."""

from __future__ import annotations

import pytest

from bus_schema.authority import may_call, party_of, rights_of
from bus_schema.stream import EVERYONE, Party


@pytest.mark.parametrize(
    ("name", "party"),
    [
        ("robot_sim", "robot_sim"),
        ("agent_torso", "agent"),
        ("agent", "client"),
        ("gaze", "behaviour"),
        ("behaviour", "client"),
        ("operator", "operator"),
        ("my_tool", "client"),
    ],
)
def test_a_name_has_a_party(name: str, party: Party) -> None:
    assert party_of(name) == party


def test_an_agent_may_move_its_own_part_alone() -> None:
    rights = rights_of("agent_torso", "agent")
    assert "torso/rpc/goal" in rights.calls
    assert not any(key.endswith("/rpc/goal") and not key.startswith("torso/") for key in rights.calls)
    assert not any("drive" in key for key in rights.calls)
    assert {key for key in rights.writes if key.startswith("agents/")} == {
        "agents/torso/transition", "agents/torso/decision", "agents/torso/learned",
    }  # fmt: skip


@pytest.mark.parametrize("party", EVERYONE)
def test_each_speaks_under_its_own_name_and_may_stop_the_robot(party: Party) -> None:
    name = "agent_head" if party == "agent" else party
    rights, called = rights_of(name, party), "mobee" if party == "operator" else name
    spoken = (
        *rights.tokens,
        *(key for key in (*rights.writes, *rights.answers) if "{" in key or key.startswith(("event/", "done/", "served/"))),
    )
    assert all(any(chunk == called or chunk == f"{called}_$*" for chunk in key.split("/")) for key in spoken), spoken
    assert "estop" in rights.writes
    assert {"clock", "**"} & set(rights.reads)


def test_only_a_person_and_the_filter_may_release_the_robot() -> None:
    assert {party for party in EVERYONE if "estop/rpc/reset" in rights_of(party, party).calls} == {"operator", "monitor", "port_filter"}


def test_an_observer_changes_nothing() -> None:
    rights = rights_of("observer", "observer")
    assert {key.split("/")[0] for key in rights.writes} == {"estop", "event", "served"}
    assert set(rights.calls) == {"*/rpc/stat", "*/rpc/config", "*/meta", "model/rpc/world/list", "model/rpc/jacobian"}


@pytest.mark.parametrize(
    ("who", "key", "may"),
    [
        ("model", "sim/rpc/pause", False),
        ("monitor", "sim/rpc/pause", True),
        ("my_tool", "sim/rpc/pause", True),
        ("agent_torso", "torso/rpc/goal", True),
        ("agent_torso", "torso/rpc/drive/take", False),
        ("vision", "model/rpc/stat", True),
    ],
)
def test_a_service_calls_only_what_the_table_lists_for_it(who: str, key: str, may: bool) -> None:
    assert may_call(who, key) is may
