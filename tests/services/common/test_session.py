# SPDX-License-Identifier: Apache-2.0
"""How a process finds its router."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from experiments.kit.live.launch import free_endpoint
from services.common.session import local_endpoint, open_client, open_router
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
