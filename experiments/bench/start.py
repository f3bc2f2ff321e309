# SPDX-License-Identifier: Apache-2.0
"""Start-up: times of the import, of the first evaluated pose and of the start of the whole system, and the memory of the system.

Claim: `import mobee` takes at most 0.2 s; import and first pose with its contacts take at most 0.3 s, without the start of Python itself.
The system of the scenario `default`, without its web page, is ready within 3 s and takes at most 500 MiB (PSS: memory that processes share
counts once).  The processor times of the library are judged as multiples of the time to import NumPy; in every round, each program runs in
a new process.  The time of the system is converted to the time on the standard machine (timing.py): two processes do the calibration
loop at the same time.  Memory is judged in MiB.  Run time: half a minute.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench.timing import Calibration, Crew
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress
from experiments.kit.live.launch import summary_of

NUMPY, IMPORT, POSE = "import numpy", "import mobee", "first pose"
_NUMPY_SECONDS = 0.08  # of processor time, on the standard machine
REQUIREMENTS = (
    Requirement(f"{IMPORT}, times NumPy's import", ("times_numpy", IMPORT), at_most=0.2 / _NUMPY_SECONDS),
    Requirement(f"{POSE}, times NumPy's import", ("times_numpy", POSE), at_most=0.3 / _NUMPY_SECONDS),
    Requirement("system ready, s", ("system", "standard_ready_s"), at_most=3.0),
    Requirement("system, MiB", ("system", "total_mebibytes"), at_most=500.0),
)
_PROGRAMS = {
    NUMPY: "import numpy",
    IMPORT: "import mobee",
    POSE: (
        "import mobee; model = mobee.Model(mobee.load_robot('icub'), mobee.load_world('table')); model.evaluate(model.robot.home).contacts"
    ),
}
_TIMED = (
    "import time; wall, own = time.perf_counter(), time.process_time()\n{}\nprint(time.perf_counter() - wall, time.process_time() - own)"
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `rounds`: number of rounds, in each of which every program is timed once in a new process.  `systems`: number of starts of the system.
    `seconds`: how long the system runs after each start [s].
    """

    rounds: int = 15
    systems: int = 3
    seconds: float = 5.0


QUICK = Settings(rounds=5, systems=1)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises LaunchFailed if a system does not start.

    Keys: "wall_s" and "processor_s", dicts from a program to its median wall and processor time [s]; "times_numpy", processor time over
    that of importing NumPy, by program; "system", a dict with the times until the system is ready ("ready_s", "standard_ready_s") and its
    memory [MiB] ("mebibytes" by process, "total_mebibytes"); "requirements", a list with the dict that `Requirement.judge` returns for each
    requirement; "passed", whether all are met.
    """
    rounds: list[dict[str, tuple[float, float]]] = []
    systems: list[dict[str, Any]] = []
    with Progress() as progress:
        for number in range(settings.rounds):
            progress.show(0.5 * number / settings.rounds, "the library")
            rounds.append({name: _times_in_new_process(program) for name, program in _PROGRAMS.items()})
        with Crew(2) as crew:
            speeds = Calibration(crew.loops)
            for number in range(settings.systems):
                progress.show(0.5 + 0.5 * number / settings.systems, "the system")
                systems.append(_system(settings.seconds, speeds))
    return summarized(rounds, systems)


def summarized(rounds: list[dict[str, tuple[float, float]]], systems: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the medians of all measurements and the verdict.

    `rounds`: for each round a dict from a program's name to its wall and processor time [s].  `systems`: the measurements of each start of
    the system.

    Keys: "wall_s" and "processor_s", median times [s] by program; "times_numpy", processor time over that of importing NumPy, by program;
    "system", a dict with the times until it is ready [s] and memory [MiB]; "requirements", a list with the dict that `Requirement.judge`
    returns for each requirement; "passed", whether all are met.
    """
    wall, own = ({name: np.array([one[name][which] for one in rounds]) for name in _PROGRAMS} for which in (0, 1))
    ratios = {name: float(np.median(own[name] / own[NUMPY])) for name in (IMPORT, POSE)}
    system: dict[str, Any] = {name: float(np.median([one[name] for one in systems])) for name in ("ready_s", "standard_ready_s", "speed")}
    processes: dict[str, list[float]] = {}
    for one in systems:
        for service, size in one["mebibytes"].items():
            processes.setdefault(service, []).append(size)
    system["mebibytes"] = {service: float(np.median(sizes)) for service, sizes in processes.items()}
    system["total_mebibytes"] = sum(system["mebibytes"].values())
    result = {
        "wall_s": {name: float(np.median(values)) for name, values in wall.items()},
        "processor_s": {name: float(np.median(values)) for name, values in own.items()},
        "times_numpy": ratios,
        "system": system,
    }
    return result | verdict(result, REQUIREMENTS)


def _times_in_new_process(program: str) -> tuple[float, float]:
    """Return wall and processor time [s] of a program in a process of its own."""
    done = subprocess.run([sys.executable, "-c", _TIMED.format(program)], capture_output=True, text=True, check=True)
    wall, own = map(float, done.stdout.split())
    return wall, own


def _system(seconds: float, speeds: Calibration) -> dict[str, Any]:
    """Run the default system without its web page for `seconds` [s] and return its times and memory.

    Keys: "ready_s", the time until it was ready [s]; "standard_ready_s", the same on the standard machine; "speed", the speed of this
    machine; "mebibytes", the memory [MiB] of each process at the end, as the function `mebibytes` returns it.
    """
    newest: dict[str, float] = {}

    def update(launcher: int) -> None:
        found = mebibytes(launcher)
        if len(found) >= len(newest):  # fewer: it is ending
            newest.update(found)

    summary, speed = speeds.around(lambda: summary_of("default", duration=seconds, watch=update))
    ready = float(summary["seconds_to_ready"])
    return {"ready_s": ready, "standard_ready_s": ready * speed, "speed": speed, "mebibytes": newest}


def mebibytes(launcher: int) -> dict[str, float]:
    """Return the memory [MiB] of a launcher and of each service that it has started, by name.

    `launcher`: process id.  The memory is the PSS: memory that n processes share counts 1/n for each.  The memory of a service includes
    that of its standby process, if it has one (a second process that waits to replace the first; it starts at least 10 s after the service
    is ready).  A process that has ended is absent.
    """
    found: dict[str, float] = {}
    for pid in (launcher, *_children(launcher)):
        with contextlib.suppress(OSError, StopIteration):  # the process has ended meanwhile
            words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
            lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
            kibibytes = next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
            name = "launcher" if pid == launcher else _service_name(words)
            found[name] = found.get(name, 0.0) + kibibytes / 1024.0
    return found


def _children(pid: int) -> list[int]:
    found: list[int] = []
    for thread in Path(f"/proc/{pid}/task").glob("*/children"):
        found += map(int, thread.read_text().split())
    return found


def _service_name(words: list[str]) -> str:
    """Return the name of a service, from the words of its command line.

    It is the name of the file after "--config", without its ending, because several services may run the same module.  Without such a file
    it is the module after "-m"; the module mobee_system.run, which starts others, is skipped.
    """
    if "--config" in words:
        return Path(words[words.index("--config") + 1]).stem
    modules = [word for word in words[words.index("-m") + 1 :] if word != "mobee_system.run"] if "-m" in words else words
    return modules[0]


def report(result: Mapping[str, Any]) -> str:
    """Return the result of `measure` as text: a table of times, the memory of the system, then the requirements."""
    lines = [f"{'fresh processes, medians':<30}{'wall, s':>9}{'processor, s':>14}{'x numpy':>9}"]
    for name, wall in result["wall_s"].items():
        times = f"{result['times_numpy'][name]:.2f}" if name in result["times_numpy"] else ""
        lines.append(f"  {name:<28}{wall:>9.3f}{result['processor_s'][name]:>14.3f}{times:>9}")
    system = result["system"]
    lines.append(f"default system without its page: ready after {system['ready_s']:.1f} s, {system['total_mebibytes']:.0f} MiB:")
    lines.append("  " + ", ".join(f"{service} {size:.0f}" for service, size in system["mebibytes"].items()))
    return report_text(lines, result, system["speed"])
