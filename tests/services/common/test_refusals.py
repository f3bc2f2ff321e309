# SPDX-License-Identifier: Apache-2.0
"""Zenoh's log of a router: what was refused, and what it only prepares."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

from services.common.refusals import Refusal, RefusalLog

START = "2026-11-25T22:03:43.504754Z TRACE  rx-1 ThreadId(09) zenoh::net::routing::interceptor::access_control: "
LINK = "2026-11-25T22:03:43.504754Z  WARN acc-0 ThreadId(05) zenoh_link_tls::unicast: "
PREPARED = (
    "Query", "Reply", "Put", "Delete", "Declare/Undeclare Subscriber", "Declare/Undeclare Queryable", "Declare/Undeclare Liveliness Token",
    "Liveliness Query", "Declare Liveliness Subscriber",
)  # fmt: skip


@pytest.fixture
def reads() -> Callable[..., dict[str, int]]:
    reader, writer = os.pipe()
    os.set_blocking(reader, False)
    log = RefusalLog(reader)

    def read(*lines: str) -> dict[str, int]:
        os.write(writer, "".join(f"{line}\n" for line in lines).encode())
        log.read()
        return {refusal.text: times for refusal, times in log.take().items()}

    return read


def denied(action: str, key: str = "icub/tick") -> str:
    return f"{START}ab12 on Interface(lo)+CertCommonName(vision)+Transport(Tls)+ab12 is unauthorized to {action} (ingress) on {key}"


def cached(action: str, verdict: str = "unauthorized", key: str = "icub/tick") -> str:
    return f"{START}Using cached result: ab12 is {verdict} to {action} (ingress) on {key}"


def test_what_zenoh_prepares_for_a_key_is_no_refusal(reads: Callable[..., dict[str, int]]) -> None:
    prepares = f"{START}ACL (ingress): caching permissions for `icub/tick` ..."
    assert reads(prepares, *map(denied, PREPARED)) == {}
    assert reads(cached("Put", "authorized")) == {}
    assert reads(cached("Put"), cached("Put")) == {"vision may not publish on icub/tick": 2}
    assert reads(denied("Put")) == {"vision may not publish on icub/tick": 1}  # a second time the same kind: no preparation


@pytest.mark.parametrize(
    ("action", "said"),
    [
        ("Put", "publish on"), ("Query", "call"), ("Declare Subscriber", "read"), ("Declare Queryable", "answer"),
        ("Liveliness Token", "declare the token"), ("Delete", "delete"), ("Declare Liveliness Subscriber", "read the tokens"),
    ],
)  # fmt: skip
def test_a_refusal_names_identity_action_and_key(reads: Callable[..., dict[str, int]], action: str, said: str) -> None:
    assert reads(denied(action)) == {f"vision may not {said} icub/tick": 1}


def test_a_session_without_a_name_is_a_number(reads: Callable[..., dict[str, int]]) -> None:
    assert reads(cached("Put")) == {"session ab12 may not publish on icub/tick": 1}
    said = reads(f"{START}ab12 did not match any configured ACL subject. Default permission `Deny` will be applied on all messages")
    assert said == {"session ab12 has a certificate of no identity that this system knows: it may do nothing": 1}


def test_a_refused_connection_has_its_reason(reads: Callable[..., dict[str, int]]) -> None:
    hint = ". Hint: increase the system open file limit."
    assert reads(f"{LINK}peer sent no certificates{hint}") == {"a connection was refused: peer sent no certificates": 1}
    assert reads(f"{LINK}tls handshake eof{hint}") == {}


def test_a_line_may_arrive_in_pieces(reads: Callable[..., dict[str, int]]) -> None:
    lines = f"{denied('Put')}\n{denied('Query')}"
    found = reads(lines[:300]) | reads(lines[300:])
    assert Refusal("vision may not call icub/tick").text in found
