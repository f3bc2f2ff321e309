# SPDX-License-Identifier: Apache-2.0
"""The access list of a router, asked as Zenoh reads it: an expression is allowed if an allowed one includes it."""

from __future__ import annotations

from typing import Any

import pytest
import zenoh

from bus_schema.authority import party_of
from services.common.access import access_list

NAMES = ("robot_sim", "controller", "port_filter", "agent_torso", "vision", "operator")
ACCESS: dict[str, Any] = access_list({**{name: party_of(name) for name in NAMES}, "tool": "driver"}, "icub", "icub_filtered")


def allows(name: str, message: str, key: str) -> bool:
    subject = next(one["id"] for one in ACCESS["subjects"] if name in one.get("cert_common_names", one.get("link_protocols")))
    own = next(policy["rules"] for policy in ACCESS["policies"] if policy["subjects"] == [subject])
    rules = [rule for rule in ACCESS["rules"] if rule["id"] in own and rule["flows"] == ["ingress"] and message in rule["messages"]]
    return any(zenoh.KeyExpr(allowed).includes(zenoh.KeyExpr(key)) for rule in rules for allowed in rule["key_exprs"])


def test_what_is_not_listed_is_denied() -> None:
    assert (ACCESS["enabled"], ACCESS["default_permission"]) == (True, "deny")
    assert {rule["permission"] for rule in ACCESS["rules"]} == {"allow"}


@pytest.mark.parametrize(
    ("name", "message", "key", "allowed"),
    [
        ("controller", "put", "icub/commands", True),
        ("vision", "put", "icub/commands", False),
        ("vision", "put", "icub/world/ball", True),
        ("operator", "declare_subscriber", "icub/**", True),
        ("vision", "declare_subscriber", "icub/**", False),
        ("controller", "declare_queryable", "icub/*/rpc/take", True),
        ("agent_torso", "query", "icub/torso/rpc/goal", True),
        ("agent_torso", "query", "icub/*/rpc/goal", False),
        ("agent_torso", "liveliness_token", "icub/alive/agent_torso/i1", True),
        ("agent_torso", "liveliness_token", "icub/alive/controller/i1", False),
        ("operator", "liveliness_token", "icub/alive/mobee_reach_12/i1", True),
        ("agent_torso", "declare_queryable", "icub/event/agent_torso/@adv/pub/1/2/_", True),
        ("agent_torso", "declare_queryable", "icub/event/model/@adv/pub/1/2/_", False),
        ("vision", "liveliness_query", "icub/alive/*/*", True),
        ("unixsock-stream", "query", "icub/estop/rpc/reset", True),
        ("unixsock-stream", "put", "icub/tick", False),
    ],
)
def test_each_may_send_what_is_its_own(name: str, message: str, key: str, allowed: bool) -> None:
    assert allows(name, message, key) is allowed


@pytest.mark.parametrize(
    ("name", "message", "key", "allowed"),
    [
        ("port_filter", "put", "icub_filtered/tick", True),
        ("port_filter", "put", "icub/tick", False),
        ("port_filter", "declare_queryable", "icub_filtered/*/rpc/drive/take", True),
        ("port_filter", "declare_queryable", "icub_filtered/*/rpc/waypoint", True),
        ("port_filter", "declare_queryable", "icub/*/rpc/drive/take", False),
        ("port_filter", "query", "icub/torso/rpc/drive/take", True),
        ("port_filter", "liveliness_token", "icub_filtered/alive/router/i1", True),
        ("port_filter", "liveliness_token", "icub/alive/router/i1", False),
        ("tool", "query", "icub_filtered/torso/rpc/drive/take", True),
    ],
)
def test_the_filter_is_the_robot_for_its_clients_only(name: str, message: str, key: str, allowed: bool) -> None:
    assert allows(name, message, key) is allowed
