# SPDX-License-Identifier: Apache-2.0
"""How a process finds its router."""

from __future__ import annotations

import os
import select
import socket
import sys
from pathlib import Path

import pytest

from experiments.kit.live.launch import free_endpoint
from services.common.session import local_endpoint, open_client, open_router, receive_together, sockets_at
from tests.services.harness import wait_for


def test_a_router_is_found_by_its_local_endpoint_and_by_its_endpoint() -> None:
    endpoint, heard = free_endpoint(), []
    with local_endpoint() as local, open_router(endpoint, local_endpoint=local), open_client(local) as near, open_client(endpoint) as far:
        far.declare_subscriber("what", lambda sample: heard.append(sample.payload.to_string()))
        publisher = near.declare_publisher("what")
        wait_for(lambda: publisher.matching_status.matching, "the subscriber")
        publisher.put("this")
        wait_for(lambda: heard == ["this"], "the message")


def test_the_local_endpoint_is_private_and_is_removed() -> None:
    with local_endpoint() as local:
        folder = Path(local.removeprefix("unixsock-stream/")).parent
        with open_router(free_endpoint(), local_endpoint=local):
            assert folder.stat().st_mode & 0o077 == 0
            assert os.listdir(folder)
    assert not folder.exists()


def test_there_is_no_local_endpoint_where_its_name_would_be_too_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    deep = tmp_path / ("deep" * 25)
    deep.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(deep))
    with local_endpoint() as local:
        assert local == ""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux wakes a process for several bytes together")
def test_a_connection_wakes_this_process_once_enough_bytes_wait() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)) as client, listener.accept()[0] as server:
            found = sockets_at(f"tcp/127.0.0.1:{port}")
            assert sorted(found) == sorted([listener.fileno(), client.fileno()])
            receive_together([*found, 999_999], 1000)  # the last is no descriptor: closed meanwhile
            server.sendall(bytes(10))
            assert select.select([client], [], [], 0.2)[0] == []
            receive_together(found, 1)
            assert select.select([client], [], [], 5.0)[0] == [client]
            assert client.recv(100) == bytes(10)


def test_an_endpoint_without_a_port_has_no_sockets() -> None:
    assert sockets_at("unixsock-stream//somewhere/bus") == []
