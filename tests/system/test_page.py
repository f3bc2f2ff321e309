# SPDX-License-Identifier: Apache-2.0
"""The page in a browser: it tells the story, acts on the robot, and says when it was stopped and when the system has ended."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import Geometry
from bus_schema.rpc import AddObject, Done, Empty, ObjectState, World
from experiments.live_picture import find_chromium
from services.common import rpc
from tests.system.live import PARTS, Launch, Watcher, free_port, running

pytestmark = [pytest.mark.system, pytest.mark.skipif(find_chromium() is None, reason="page: no Chromium")]

SCENARIO = str(Path(__file__).with_name("page.toml"))
PATIENCE = 60.0  # s for what takes a second on a free machine
WITHOUT_DRAWING = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")


class Browser:
    """A page of the monitor; `requests`: the addresses that the browser asked for."""

    def __init__(self, browser: Any, url: str) -> None:
        self.page, self.url, self.requests = browser.new_page(viewport={"width": 1280, "height": 720}), url, list[str]()
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.route("**/viewer.html*", lambda route: route.abort())  # drawn in software it would take all of the machine
        self.page.goto(url)

    def holds(self, condition: str) -> bool:
        """Whether a condition in JavaScript is true; `wait_for_function` of Playwright is forbidden by the page's policy."""
        return bool(self.page.evaluate(f"Boolean({condition})"))

    def until(self, condition: str, what: str) -> float:
        """Wait for a condition; returns how long it took, s."""
        begin = time.monotonic()
        while not self.holds(condition):
            said = self.page.inner_text("body")[:1500]
            assert time.monotonic() - begin < PATIENCE, f"{what} is not there after {PATIENCE:g} s: {said}"
            time.sleep(0.05)
        took = time.monotonic() - begin
        print(f"page: {what} after {took:.2f} s")
        return took

    def until_said(self, title: str) -> None:
        self.until(
            f"!document.querySelector('#banner').hidden && document.querySelector('#banner h1').textContent.includes({title!r})", title
        )

    def press(self, key: str) -> None:
        self.page.keyboard.press(key)


CALM = "document.querySelector('#banner').hidden"
TRIES = r"/Tries .*[+−]\d+°.* \d+(st|nd|rd|th) try from here/"  # absent between an outcome and the next decision
TELLS = "document.querySelector('.card .now')"


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launch, Watcher]]:
    settings = [f"services.monitor.web_port={free_port()}"]
    with running(tmp_path_factory.mktemp("page"), SCENARIO, *settings, headless=False) as pair:
        yield pair


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=find_chromium(), args=list(WITHOUT_DRAWING))
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def page(live: tuple[Launch, Watcher], browser: Any) -> Browser:
    return Browser(browser, re.findall(r"http://\S+", live[1].stat("monitor").text)[0])


def test_the_story_is_told_at_once_and_nothing_is_loaded_from_elsewhere(page: Browser) -> None:
    page.until(TELLS, "the story")
    page.until("document.querySelector('.card').textContent.includes('nats')", "the first outcome with its surprise")
    page.until(f"{TRIES}.test(document.querySelector('#cards').innerText)", "the action that an agent tries")
    assert {urlsplit(address).netloc for address in page.requests} == {urlsplit(page.url).netloc}


def test_pause_and_stop_act_on_the_robot_and_are_said(page: Browser, live: tuple[Launch, Watcher]) -> None:
    _, watcher = live
    page.press(" ")
    page.until_said("Paused")
    k = watcher.k
    time.sleep(0.5)
    assert watcher.k <= k + 1
    page.press(" ")
    page.until(CALM, "the end of the pause")
    page.press("s")
    page.until_said("EMERGENCY STOP")
    assert {watcher.states[part][-1].gate for part in PARTS} == {"estop"}
    page.press("r")
    page.until(CALM, "the release")
    page.until(TELLS, "the next action")


def test_the_ball_is_dragged_and_a_hand_reaches_for_it(page: Browser, live: tuple[Launch, Watcher]) -> None:
    session = live[1].session
    ball = {"name": "ball", "geometry": Geometry("sphere", [0.03]), "position": [-0.35, 0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}
    rpc.call(session, "test", keys.world_rpc("add"), AddObject, Done, tries=9, **ball, role="target")
    page.press("3")  # from above: what is dragged moves horizontally
    targets = "JSON.parse(document.querySelector('#body').dataset.targets || '{}')"
    page.until(f"{targets}.ball", "the ball in the picture")
    time.sleep(0.5)  # the picture turns
    x, y = page.page.evaluate(f"{targets}.ball")
    mouse = page.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 10.0, y)
    mouse.move(x - 25.0, y, steps=5)
    mouse.up()
    page.until("document.querySelector('#cards').textContent.includes('eaches for the ball')", "the reach")
    page.until("document.querySelector('#cards').textContent.match(/mm from it/)", "the end of the reach")
    moved = {one.name: one for one in world(session)}["ball"].position
    assert np.linalg.norm(np.array(moved) - ball["position"]) > 0.01
    missing = float(re.search(r"(\d+) mm from it", page.page.inner_text("#cards"))[1])  # type: ignore[index]  # waited for above
    print(f"page: the hand rests {missing:g} mm from the ball")
    page.until("document.querySelector('.card').textContent.includes('Tries')", "the agent's next action, after the part was given back")


def world(session: Any) -> list[ObjectState]:
    return list(rpc.call(session, "test", keys.world_rpc("list"), Empty, World, tries=9).objects)


def test_of_two_pages_one_holds_the_controls(page: Browser, browser: Any) -> None:
    other = Browser(browser, page.url)
    other.until(TELLS, "the second page's story")
    other.press(" ")
    other.until("document.querySelector('#said').textContent.includes('another page holds the controls')", "the refusal")
    assert page.holds(CALM)
    other.press("c")
    other.until("document.querySelector('#holder').textContent.includes('this one')", "the controls")
    page.until("document.querySelector('#holder').textContent.includes('another one')", "the loss of the controls")
    other.page.close()


def test_the_end_of_the_system_is_said(page: Browser, live: tuple[Launch, Watcher]) -> None:
    """The last test of this file: it ends the system."""
    live[0].process.send_signal(signal.SIGINT)
    page.until_said("ended")
    page.until("document.querySelector('#banner').textContent.includes('mobee launch')", "what to do")
