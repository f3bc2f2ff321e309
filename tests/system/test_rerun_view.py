# SPDX-License-Identifier: Apache-2.0
"""Rerun's view in a browser that draws in software: it shows a robot that moves, asks for frames one by one, and passes keys on."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from experiments.live_picture import find_chromium
from mobee.robot.load import load_robot
from tests.system.browsers import BRIGHT, picture

pytest.importorskip("rerun")
from services.monitor.viewer.blueprint import TIMELINE, blueprint, shown_of  # noqa: E402  # only where Rerun is
from services.monitor.viewer.files import ViewerFiles  # noqa: E402  # only where Rerun is
from services.monitor.viewer.frames import Frames  # noqa: E402  # only where Rerun is
from services.monitor.viewer.output import NoControls  # noqa: E402  # only where Rerun is
from services.monitor.viewer.scene import Scene  # noqa: E402  # only where Rerun is
from services.monitor.web.board import Board  # noqa: E402  # only where Rerun is
from services.monitor.web.server import PageServer, Site  # noqa: E402  # only where Rerun is

pytestmark = [pytest.mark.system, pytest.mark.skipif(find_chromium() is None, reason="Rerun's view: no Chromium")]

PATIENCE = 150.0  # s for what takes some seconds on a free machine
DRAW_IN_SOFTWARE = ("--no-sandbox", "--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader", "--ignore-gpu-blocklist")
SIZE = {"width": 800, "height": 500}  # pixels


@pytest.fixture
def served(tmp_path: Path) -> Iterator[PageServer]:
    """A page without a system: the Katana swings by its first joint."""
    robot = load_robot("katana")
    frames = Frames(None, blueprint(shown_of(robot), in_motion=False), "test")
    scene, ends = Scene(frames, robot), threading.Event()
    server = PageServer(Site(Board(), "", NoControls(), frames, ViewerFiles(tmp_path).path, time.monotonic), "127.0.0.1", 0)

    def swing() -> None:
        begin = time.monotonic()
        while not ends.wait(0.05):
            q = robot.home.copy()
            q[0] += np.sin(time.monotonic() - begin)
            frames.set_time(TIMELINE, time.monotonic() - begin)
            frames.begin_update()
            scene.log_robot(q, [])
            frames.end_update()

    moving = threading.Thread(target=swing)
    moving.start()
    yield server
    ends.set()
    moving.join()
    server.close()
    frames.close()


def test_rerun_s_view_shows_a_robot_that_moves(served: PageServer) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find_chromium(), args=list(DRAW_IN_SOFTWARE))
        page = browser.new_page(viewport=SIZE)
        begin, asked = time.monotonic(), list[str]()
        page.on("request", lambda request: asked.append(request.url))
        page.goto(f"http://127.0.0.1:{served.port}/")
        page.keyboard.press("v")

        viewer = page.locator("#viewer")
        first = picture(viewer)
        while not page.evaluate("document.querySelector('#scene').hidden") or (first.max(axis=2) > BRIGHT).mean() < 0.02:
            assert time.monotonic() - begin < PATIENCE, "there is no robot in Rerun's view"
            first = picture(viewer)
        print(f"Rerun's view: the robot after {time.monotonic() - begin:.1f} s")
        while (np.abs(picture(viewer) - first).max(axis=2) > BRIGHT).mean() < 0.002:
            assert time.monotonic() - begin < PATIENCE, "the robot in Rerun's view does not move"
        numbers = [int(address.partition("after=")[2]) for address in asked if "/frame?" in address]
        assert numbers[0] == 0 and numbers == sorted(numbers)
        viewer.click()  # Rerun has the keys now, and passes them on
        page.keyboard.press("v")
        while not page.evaluate("!document.querySelector('#viewer').src && !document.querySelector('#scene').hidden"):
            assert time.monotonic() - begin < PATIENCE, "Rerun's view is not left by a key that it passes on"
        browser.close()
