# SPDX-License-Identifier: Apache-2.0
"""The time that `mobee play` needs from the command to the first curious action that a browser shows, with an empty home folder.

Claim: the web page shows the first action of a curious agent at most 20 s after the command, 5 s of which are learning offline.  Each start
is a command of its own, with an empty home and an empty working directory, and headless Chromium opens the page as soon as its address is
printed.  The 3D view is not loaded: without a graphics card the browser would draw it on the processor.  The time without the learning is
converted to the time that the standard machine (timing.py) needs.  For this, the speed of this machine is measured by two processes
that do the same fixed work (the calibration loop) at the same time.  At the end the system is stopped as by Ctrl-C.  Run time: 25 s per
robot.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from experiments.bench.peers import import_peer
from experiments.bench.timing import Calibration, Crew
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress
from experiments.kit.live.launch import LaunchFailed, free_endpoint, free_port, stop
from experiments.live_picture import find_chromium
from mobee.errors import NotInstalled

LEARNING = 5.0  # s of real time, fixed
TIMEOUT = 180.0  # s for one start
REQUIREMENTS = (Requirement("slowest robot on the page, s", ("slowest_standard_s",), at_most=20.0),)
WITHOUT_DRAWING = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")
TRIES = "Boolean(document.querySelector('.card .now'))"
STEPS = {  # by what the command prints
    "derived": r"learns|torso, left_arm and right_arm learn",
    "learned offline": r"Continues live",
    "page served": r"monitor is ready after .*: http://",
    "all services ready": r"all ready after",
}
SHOWN = "first action on the page"


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `robots`: names or files of robots, as for `mobee play`.  `python`: the interpreter whose MoBeE is measured, by default this one.
    `rounds`: starts of each robot.
    """

    robots: Sequence[str] = field(default=("icub",))
    python: str = sys.executable
    rounds: int = 3


QUICK = Settings(rounds=1)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises NotInstalled without Chromium or Playwright.

    Raises LaunchFailed if a start of a robot does not succeed.

    Main keys: "starts", a list with a dict for each start; "slowest_standard_s", the median of "standard_s" of the slowest robot [s];
    "ends_clean", whether every system ended without error and left no process behind; "requirements", a list with the dict that
    `Requirement.judge` returns for each requirement; "passed", whether all are met and the ends were clean.

    Main keys of a start: "robot", its name or file; "steps", a dict from each step to the time [s] since the command, up to the first
    action on the page; "standard_s", the time of that action [s] on the standard machine (the one for which the requirements were set);
    "clean", whether the system ended without error and left no process behind.
    """
    chromium = find_chromium()
    if chromium is None:
        raise NotInstalled("Chromium is not installed: apt-get install chromium")
    playwright = import_peer("playwright.sync_api", "Playwright", "dev")
    starts: list[dict[str, Any]] = []
    todo = [robot for _ in range(settings.rounds) for robot in settings.robots]
    with Progress() as progress, Crew(2) as crew, playwright.sync_playwright() as playing:
        browser = playing.chromium.launch(executable_path=chromium, args=list(WITHOUT_DRAWING))
        speeds = Calibration(crew.loops)
        for number, robot in enumerate(todo):
            progress.show(number / len(todo), robot)
            start, speed = speeds.around(partial(_start, robot, settings.python, browser))
            learning = start["steps"]["learned offline"] - start["steps"]["derived"]
            standard = LEARNING + (start["steps"][SHOWN] - min(learning, LEARNING)) * speed
            starts.append(start | {"robot": robot, "speed": speed, "standard_s": standard, "load": os.getloadavg()[0]})
        browser.close()
    result: dict[str, Any] = {"python": _version(settings.python), "starts": starts, "speed": speeds.median}
    result["slowest_standard_s"] = max(_median(starts, robot)["standard_s"] for robot in settings.robots)
    return result | verdict(result, REQUIREMENTS, ends_clean=all(start["clean"] for start in starts))


def _start(robot: str, python: str, browser: Any) -> dict[str, Any]:
    """Start once, wait for the first action on the page, and end; returns the time of each step [s]."""
    given = str(Path(robot).resolve()) if Path(robot).exists() else robot
    with tempfile.TemporaryDirectory() as home:
        port = free_port()
        command = [python, "-m", "mobee_system", "play", given, "--endpoint", free_endpoint(), "--set", f"services.monitor.web_port={port}"]
        said = Path(home) / "said.txt"
        with said.open("wb") as output:
            begin = time.monotonic()
            process = subprocess.Popen(command, cwd=home, env=_environment(home, python), stdout=output, stderr=output, process_group=0)
        try:
            steps = dict(_steps(process, said, browser, begin))
        except TimeoutError as error:
            raise LaunchFailed(f"mobee play {robot}: {error}; it said: {said.read_text()[-500:]}") from None
        finally:
            ending = time.monotonic()
            code = stop(process)
        clean = code == 0 and "Traceback" not in said.read_text() and not _left(home)
        return {"steps": steps, "ending_s": time.monotonic() - ending, "clean": clean}


def _environment(home: str, python: str) -> dict[str, str]:
    """Return the environment variables for a process: a few of this process, and `home` as HOME.

    `python`: interpreter of the process.  Only if it is the interpreter of this process, PYTHONPATH is kept, so that it can import the same
    checkout.
    """
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "LC_ALL", "TERM") if name in os.environ}
    if python == sys.executable and "PYTHONPATH" in os.environ:
        kept["PYTHONPATH"] = os.environ["PYTHONPATH"]
    return kept | {"HOME": home}


def _steps(process: subprocess.Popen[bytes], said: Path, browser: Any, begin: float) -> Iterator[tuple[str, float]]:
    """Yield the name and the time [s] of each step of a start (the keys of STEPS, then SHOWN) as soon as it happens.

    `said`: file with the output of `process`.  `begin`: monotonic time [s] from which the times count.  Raises TimeoutError if the process
    ends, or if the last step has not happened after TIMEOUT (180 s).
    """
    text, page, left = "", None, dict(STEPS)
    while True:
        if process.poll() is not None or time.monotonic() - begin > TIMEOUT:
            raise TimeoutError("it ended" if process.poll() is not None else f"no action after {TIMEOUT:g} s")
        text = said.read_text()
        for name in [name for name, pattern in left.items() if re.search(pattern, text)]:
            del left[name]
            yield name, time.monotonic() - begin
        if page is None and "page served" not in left:
            page = browser.new_page()
            page.route("**/viewer.html*", lambda route: route.abort())
            page.goto(re.findall(r"http://\S+", text)[0])
        if page is not None and "all services ready" not in left and page.evaluate(TRIES):
            yield SHOWN, time.monotonic() - begin
            page.close()
            return
        time.sleep(0.02)


def _left(home: str) -> list[int]:
    """Return the ids of the running processes whose command line contains a path in the folder `home`.

    These are services that were left behind, because the command line of each service names its file of settings.  Without /proc (on other
    systems than Linux) the list is empty.
    """
    found = []
    for line in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):  # the process has ended meanwhile
            if f"{home}/" in line.read_text(errors="replace"):
                found.append(int(line.parent.name))
    return found


def _version(python: str) -> str:
    return subprocess.run([python, "--version"], capture_output=True, text=True, check=True).stdout.strip()


def _median(starts: Sequence[dict[str, Any]], robot: str) -> dict[str, Any]:
    """Return the start of a robot with the median time."""
    own = sorted((start for start in starts if start["robot"] == robot), key=lambda start: start["standard_s"])
    return own[len(own) // 2]


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: for each robot the times of the steps of its median start, then the requirements."""
    robots = list(dict.fromkeys(start["robot"] for start in result["starts"]))
    lines = [f"{result['python']}; seconds after the command, of the start with the median time:"]
    for robot in robots:
        start = _median(result["starts"], robot)
        lines.append(f"{Path(robot).name}, load {start['load']:.1f}:")
        lines += [f"  {name:<28}{seconds:>7.1f}" for name, seconds in start["steps"].items()]
        lines.append(f"  {'the same in standard time':<28}{start['standard_s']:>7.1f}")
        state = "" if start["clean"] else ", with a process left, an error or an exit code"
        lines.append(f"  ended {start['ending_s']:.1f} s after Ctrl-C{state}")
    return report_text(lines, result, result["speed"])
