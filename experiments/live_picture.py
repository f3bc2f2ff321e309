# SPDX-License-Identifier: Apache-2.0
"""Take the picture of the running system: start a scenario, open its page in headless Chromium, take a screenshot.

`mobee learn --robot icub --transitions 2000 --store icub.sqlite`, then `python -m experiments.live_picture --scenario icub.toml --warm-up
25`, write docs/figures/live.png.  The picture shows agents that have learned for 80 minutes offline.
"""

from __future__ import annotations

import argparse
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = ("/usr/bin/chromium", "/usr/bin/chromium-browser")
WITHOUT_GRAPHICS = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")
SIZE = (1280, 720)  # pixels
START_TIMEOUT = 120.0  # s for the system to start
STORY_TIMEOUT = 60.0  # s for the story of an agent
POLL_PERIOD = 0.5  # s
FIGURES = Path(__file__).parents[1] / "docs" / "figures"
IS_TOLD = "Boolean(document.querySelector('.card .now'))"


def main(argv: Sequence[str] | None = None) -> int:
    """Take the screenshots and print their paths; returns 0, or 1 with a message if Chromium is not installed.

    `argv`: arguments of the command line; None: those of the process.
    """
    options = _options(argv)
    chromium = find_chromium()
    if chromium is None:
        print("live picture: no Chromium. Install it: apt-get install chromium", file=sys.stderr)
        return 1
    options.out.mkdir(parents=True, exist_ok=True)
    with _attached(options.url) if options.url else _launched(options.scenario, options.set) as url:
        for path in take(url, chromium, options.out, options.size, options.shots, options.gap, options.warm_up):
            print(path)
    return 0


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Take a picture of the running system.")
    parser.add_argument("--url", default="", help="address of the page of a system that runs already")
    parser.add_argument("--scenario", default="default", help="the scenario to start otherwise")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE", help="change a setting of the scenario")
    parser.add_argument("--size", type=int, nargs=2, default=SIZE, metavar=("WIDTH", "HEIGHT"), help="pixels (default: 1280 720)")
    parser.add_argument("--shots", type=int, default=1)
    parser.add_argument("--gap", type=float, default=10.0, help="s between two shots")
    parser.add_argument("--warm-up", type=float, default=45.0, help="s from the begin of the story to the first shot")
    parser.add_argument("--out", type=Path, default=FIGURES, help="folder for live.png, or live-1.png, live-2.png, ...")
    return parser.parse_args(argv)


def find_chromium() -> str | None:
    """Return the path of Chromium, or None if it is not installed."""
    return next((path for path in CHROMIUM if Path(path).exists()), shutil.which("chromium"))


def take(url: str, chromium: str, folder: Path, size: Sequence[int], shots: int, gap: float, warm_up: float) -> Iterator[Path]:
    """Take screenshots of the page with headless Chromium, and yield the path of each PNG file.

    Args:
        url: address of the page.
        chromium: path of the program.
        folder: where the files are written.
        size: width and height of the page, pixels.
        shots: number of screenshots.
        gap: time between two screenshots, s.
        warm_up: time from the first text about an agent on the page to the first screenshot, s.
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(WITHOUT_GRAPHICS))
        page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme="dark")
        page.goto(url)
        _wait_until_told(page, url)
        time.sleep(warm_up)
        for shot in range(1, shots + 1):
            path = folder / ("live.png" if shots == 1 else f"live-{shot}.png")
            page.screenshot(path=path, timeout=0)
            yield path
            if shot < shots:
                time.sleep(gap)
        browser.close()


def _wait_until_told(page: Any, url: str) -> None:
    give_up = time.monotonic() + STORY_TIMEOUT
    while not page.evaluate(IS_TOLD):
        if time.monotonic() > give_up:
            raise SystemExit(f"live picture: the page at {url} shows no text about the agents within {STORY_TIMEOUT:g} s")
        time.sleep(POLL_PERIOD)


@contextmanager
def _attached(url: str) -> Iterator[str]:
    yield url


@contextmanager
def _launched(scenario: str, settings: Sequence[str]) -> Iterator[str]:
    """Start a system on free ports, yield the address of its page, and stop the system as by Ctrl-C."""
    router, web = free_ports(2)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "mobee_system", "launch", scenario, "--page", "--runs", folder]
        command += ["--endpoint", f"tcp/127.0.0.1:{router}"]
        for setting in (f"services.monitor.web_port={web}", *settings):
            command += ["--set", setting]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True) as launcher:
            try:
                yield _address(launcher)
            finally:
                launcher.send_signal(signal.SIGINT)
                launcher.communicate(timeout=60.0)


def _address(launcher: subprocess.Popen[str]) -> str:
    """Return the address of the page, with its key, from the output of the launcher."""
    give_up = time.monotonic() + START_TIMEOUT
    assert launcher.stderr is not None
    for line in launcher.stderr:
        found = re.search(r"http://127\.0\.0\.1:\S+", line)
        if found:
            return found[0]
        if time.monotonic() > give_up:
            break
    raise SystemExit("live picture: the system did not start")


def free_ports(count: int) -> list[int]:
    """Return `count` TCP ports of the loopback interface that are free now."""
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [int(probe.getsockname()[1]) for probe in probes]
    for probe in probes:
        probe.close()
    return ports


if __name__ == "__main__":
    raise SystemExit(main())
