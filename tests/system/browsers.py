# SPDX-License-Identifier: Apache-2.0
"""Browsers that open the page: Chromium by Playwright, also with a share of a core only, and Firefox by its own remote protocol."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import psutil
from numpy.typing import NDArray

from experiments.live_picture import WITHOUT_GRAPHICS, find_chromium

BRIGHT = 60  # of 255: brighter than the ground of a 3D view
PATIENCE = 60.0  # s for what takes a second on a free machine
CYCLE = 0.01  # s between two checks of a limited browser


def until(holds: Callable[[], bool], what: str, said: Callable[[], str] = str) -> float:
    """Wait for a condition; returns how long it took, s."""
    begin = time.monotonic()
    while not holds():
        assert time.monotonic() - begin < PATIENCE, f"{what} is not there after {PATIENCE:g} s: {said()[:1500]}"
        time.sleep(0.05)
    took = time.monotonic() - begin
    print(f"page: {what} after {took:.2f} s")
    return took


def picture(shown: Any) -> NDArray[np.float64]:
    """What a browser shows of an element, a `Locator` of Playwright: (rows, columns, 3), 0 to 255."""
    shot = np.frombuffer(shown.screenshot(timeout=0), dtype=np.uint8)
    return np.asarray(cv2.imdecode(shot, cv2.IMREAD_COLOR), dtype=np.float64)


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser of Playwright that has no graphics card."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=find_chromium(), args=list(WITHOUT_GRAPHICS))
        yield opened
        opened.close()


class Page:
    """A page of the monitor in Chromium; `requests`: the addresses that the browser asked for."""

    def __init__(self, browser: Any, url: str) -> None:
        self.page, self.url, self.requests = browser.new_page(viewport={"width": 1280, "height": 720}), url, list[str]()
        self.faults: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.goto(url)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in JavaScript."""
        return self.page.evaluate(expression)

    def until(self, condition: str, what: str) -> float:
        """Wait for a condition in JavaScript; `wait_for_function` of Playwright is forbidden by the page's policy."""
        return until(lambda: bool(self.evaluate(f"Boolean({condition})")), what, lambda: str(self.page.inner_text("body")))

    def until_said(self, title: str) -> None:
        """Wait until the banner says something."""
        self.until(said(title), title)

    def press(self, key: str) -> None:
        """Press a key."""
        self.page.keyboard.press(key)


def said(title: str) -> str:
    """The condition that the banner says something."""
    return f"!document.querySelector('#banner').hidden && document.querySelector('#banner h1').textContent.includes({title!r})"


@contextmanager
def limited(share: float) -> Iterator[None]:
    """Give all browsers that this process has started a share of a core: they are stopped while they have used more than that."""
    processes = [one for one in psutil.Process().children(recursive=True) if "chrom" in one.name()]
    ends = threading.Event()
    limit = threading.Thread(target=_limit, args=(processes, share, ends), daemon=True)
    limit.start()
    try:
        yield
    finally:
        ends.set()
        limit.join()


def _limit(processes: list[psutil.Process], share: float, ends: threading.Event) -> None:
    begin, used = time.monotonic(), _used(processes)
    stopped = False
    while not ends.wait(CYCLE):
        is_over = _used(processes) - used > share * (time.monotonic() - begin)
        if is_over != stopped:
            _signal(processes, signal.SIGSTOP if is_over else signal.SIGCONT)
            stopped = is_over
    _signal(processes, signal.SIGCONT)


def _used(processes: list[psutil.Process]) -> float:
    """Time of a processor that they have used, s."""
    total = 0.0
    for one in processes:
        with suppress(psutil.NoSuchProcess):
            times = one.cpu_times()
            total += times.user + times.system
    return total


def _signal(processes: list[psutil.Process], number: signal.Signals) -> None:
    for one in processes:
        with suppress(psutil.NoSuchProcess):
            one.send_signal(number)


def find_firefox() -> str | None:
    """Return the path of Firefox, or None if it is not installed."""
    return shutil.which("firefox-esr") or shutil.which("firefox")


class Firefox:
    """A page in Firefox, which answers commands of WebDriver BiDi on a socket of its own: no driver program is needed."""

    def __init__(self, url: str, folder: Path) -> None:
        from websockets.sync.client import connect

        command = [str(find_firefox()), "--headless", "--no-remote", "--remote-debugging-port", "0", "--profile", str(folder)]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        assert self._process.stderr is not None
        address = next(found[0] for line in self._process.stderr if (found := re.findall(r"ws://\S+", line)))
        threading.Thread(target=self._process.stderr.read, daemon=True).start()  # a full pipe would stop it
        self._session = connect(f"{address}/session", max_size=None)
        self._socket = self._session.__enter__()
        self._number = 0
        self._call("session.new", capabilities={})
        self._context = self._call("browsingContext.getTree")["contexts"][0]["context"]
        self._call("browsingContext.navigate", context=self._context, url=url, wait="interactive")

    def close(self) -> None:
        """End the browser."""
        self._session.__exit__(None, None, None)
        self._process.terminate()
        self._process.wait(20.0)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in JavaScript, as JSON data."""
        text = f"JSON.stringify({expression})"
        answer = self._call("script.evaluate", expression=text, target={"context": self._context}, awaitPromise=False)
        assert answer["type"] == "success", answer
        return json.loads(answer["result"].get("value", "null"))

    def until(self, condition: str, what: str) -> float:
        """Wait for a condition in JavaScript."""
        return until(lambda: bool(self.evaluate(f"Boolean({condition})")), what, lambda: str(self.evaluate("document.body.innerText")))

    def press(self, key: str) -> None:
        """Press a key."""
        actions = [{"type": kind, "value": key} for kind in ("keyDown", "keyUp")]
        self._call("input.performActions", context=self._context, actions=[{"type": "key", "id": "keys", "actions": actions}])

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=PATIENCE))
            if answer.get("id") == self._number:
                assert answer["type"] == "success", answer
                return dict(answer["result"])
