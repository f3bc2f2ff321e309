# SPDX-License-Identifier: Apache-2.0
"""The access list of a secured router, in Zenoh's form, made from the rights of each party (bus_schema/authority.py)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from bus_schema.authority import ROUTER, Rights, rights_of
from bus_schema.keys import ALL_ALIVE
from bus_schema.stream import Party

_HISTORY = "@adv"  # chunk of the keys by which Zenoh's advanced publishers and subscribers exchange past messages
_ALL = ("put", "delete", "declare_subscriber", "declare_queryable", "query", "reply", "liveliness_token")
_TO_CLIENTS = [*_ALL, "liveliness_query", "declare_liveliness_subscriber"]

FILTER: Party = "port_filter"  # in the namespace of its clients it has the place of ROBOT
ROBOT: Party = "robot_sim"
OPERATOR: Party = "operator"
_SOCKET = "unixsock-stream"  # the protocol of a socket in the folder of keys, which only the user of the system reaches


def access_list(identities: Mapping[str, Party], namespace: str, clients: str = "") -> dict[str, object]:
    """Return Zenoh's setting `access_control` for a secured router.

    Everything that the setting does not allow is denied. An identity that is not listed may do nothing.

    Args:
        identities: a dict from the name of an identity, as in its certificate, to its party (role on the bus).
        namespace: prefix of all keys of the robot.
        clients: prefix of the keys under which the port filter's clients find the robot; empty if there is no port filter.
    """
    rules = [_rule("to all", "egress", _TO_CLIENTS, ("**", f"**/{_HISTORY}/**"))]
    subjects: list[dict[str, object]] = []
    policies: list[dict[str, object]] = []
    shown: list[tuple[dict[str, object], str, Party]] = [({"link_protocols": [_SOCKET]}, OPERATOR, OPERATOR)]
    shown += [({"cert_common_names": [name]}, name, party) for name, party in identities.items()]
    for number, (subject, name, party) in enumerate(shown):
        allowed = _ingress(rights_of(name, party), namespace)
        if clients:
            allowed += _ingress(rights_of(name, party), clients)
        if clients and party == FILTER:
            allowed += [*_ingress(rights_of(ROBOT, ROBOT), clients), (["liveliness_token"], (f"{clients}/alive/{ROUTER}/*",))]
        own = [_rule(f"{number}.{place}", "ingress", messages, keys) for place, (messages, keys) in enumerate(allowed) if keys]
        rules += own
        subjects.append({"id": str(number), **subject})
        policies.append({"subjects": [str(number)], "rules": [rule["id"] for rule in (rules[0], *own)]})
    return {"enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies}


def _rule(name: str, flow: str, messages: Sequence[str], keys: Iterable[str]) -> dict[str, object]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": list(dict.fromkeys(keys))}


def _ingress(rights: Rights, namespace: str) -> list[tuple[list[str], tuple[str, ...]]]:
    """Return what an identity may send to the router: Zenoh's kinds of messages, each with its key expressions."""

    def at(keys: Iterable[str], suffix: str = "") -> tuple[str, ...]:
        return tuple(f"{namespace}/{key}{suffix}" for key in keys)

    sent, requested = f"/{_HISTORY}/pub/**", f"/{_HISTORY}/**"
    return [
        (["put"], at(rights.writes)),
        (["declare_subscriber"], at(rights.reads)),
        (["query"], (*at(rights.calls), *at(rights.catches_up, requested))),
        (["declare_queryable", "reply"], (*at(rights.answers), *at(rights.keeps, sent))),
        (["reply"], at(rights.keeps)),  # a past message has the key with which it was published
        (["liveliness_token"], (*at(rights.tokens), *at(rights.keeps, sent))),
        (["liveliness_query", "declare_liveliness_subscriber"], (*at([ALL_ALIVE]), *at(rights.catches_up, sent))),
    ]
