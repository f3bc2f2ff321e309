# SPDX-License-Identifier: Apache-2.0
"""Calls that several processes answer."""

from __future__ import annotations

from typing import Any

import pytest
import zenoh

from bus_schema import VERSION, encode, encoding_of
from bus_schema.rpc import Stat
from services.common import rpc
from services.common.session import open_client
from tests.services.harness import Rig, wait_for


def stat(pid: int) -> Stat:
    return Stat(v=VERSION, who="twin", instance=f"i{pid}", pid=pid, uptime=0.0, ready=True, text="", numbers={}, rejected={})


@pytest.mark.parametrize("wanted", [1, 2])
def test_the_answer_of_the_wanted_process_is_chosen_whichever_comes_first(bus: Rig, wanted: int) -> None:
    """A stranger with the name of a service answers its calls too."""
    with open_client(bus.endpoint) as one, open_client(bus.endpoint) as two, open_client(bus.endpoint) as asker:
        for pid, session in ((1, one), (2, two)):

            def answer(query: zenoh.Query, pid: int = pid) -> None:
                with query:
                    query.reply("twin/rpc/stat", encode(stat(pid)), encoding=encoding_of(Stat))

            session.declare_queryable("twin/rpc/stat", answer)

        def ask(pid: int) -> Any:
            answers: list[Any] = []
            rpc.ask(asker, "test", "twin/rpc/stat", Stat, answers.append, wanted=lambda found: found.pid == pid)
            return wait_for(lambda: answers, "the answer")[0]

        wait_for(lambda: getattr(ask(wanted), "pid", 0) == wanted, "the answer of the wanted process")
        assert all(ask(wanted).pid == wanted for _ in range(10))
        assert ask(3).pid in (1, 2)  # no instance is wanted: the caller sees that another answers
