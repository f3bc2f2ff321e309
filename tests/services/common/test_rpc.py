# SPDX-License-Identifier: Apache-2.0
"""Calls that several processes answer, and what a process has sent when it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from typing import Any

import pytest
import zenoh
from zenoh.handlers import RingChannel

from bus_schema import VERSION, encode, encoding_of
from bus_schema.rpc import Stat
from experiments.kit.live.launch import free_endpoint
from services.common import rpc
from services.common.session import open_client
from tests.services.harness import ROOT, Rig, wait_for


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


ROUTER = """
import sys, time, threading
from services.common.session import open_router
with open_router(sys.argv[1]) as router:
    threading.Thread(target=sys.stdin.read).start()
    while threading.active_count() > 1:
        router.put("flood", bytes(500))
        time.sleep(0.001)
"""
MANY = 6  # of 60 kB: the router reads them one after the other


def test_what_a_closing_process_has_sent_arrives_even_if_the_router_had_no_processor_for_a_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rpc, "FLUSH_TIMEOUT", 10.0)  # on a busy machine the moment may last longer
    endpoint, heard = free_endpoint(), list[int]()
    router = subprocess.Popen([sys.executable, "-c", ROUTER, endpoint], stdin=subprocess.PIPE, cwd=ROOT)
    try:
        with open_client(endpoint) as listener:
            listener.declare_subscriber("what", lambda sample: heard.append(sample.payload.to_bytes()[0]))
            for _ in range(5):
                with open_client(endpoint) as session:
                    flood = session.declare_subscriber("flood", RingChannel(1))  # the router cannot write it once the connection is closed
                    publisher: Any = session.declare_publisher("what", congestion_control=zenoh.CongestionControl.BLOCK)
                    while not publisher.matching_status.matching:
                        time.sleep(0.001)
                    flood.recv()
                    router.send_signal(signal.SIGSTOP)
                    os.waitpid(router.pid, os.WUNTRACED)  # until all its threads have stopped
                    # Before the messages: while the system has little memory for sockets, they wait for room, and after 5 s Zenoh gives up.
                    threading.Timer(0.05, router.send_signal, [signal.SIGCONT]).start()
                    for number in range(MANY):
                        publisher.put(bytes([number]) + bytes(60_000))
                    rpc.flush(session, "probe")
            wait_for(lambda: len(heard) == 5 * MANY, "all messages")
        assert heard == [*range(MANY)] * 5
    finally:
        router.send_signal(signal.SIGCONT)
        router.communicate()
