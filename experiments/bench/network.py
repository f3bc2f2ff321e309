# SPDX-License-Identifier: Apache-2.0
"""A system on two hosts whose network is disturbed: age of the commands that the robot obeys, times until its parts stop and move again.

Claim: robot_sim obeys no command that answers a tick (control period) which began more than 100 ms ago by its clock.  Parts of the robot
hold (brake and stand still) if a cut separates them from their controller.  A part begins no new action if a cut separates it from its
agent.  Every part moves again within 5 s after the network works again.  No transition is lost, stored twice or stored with other values.
No motor is faster than the gate (the last check before the motors) allows.

The hosts are network namespaces on this machine.  Their connections are encrypted (TLS), with a key for each process.  The monotonic clock
of the second host is an hour ahead.  Packets are delayed, lost and reordered at random, with a seed.  Times are judged only if the load was
low.  Run time: 3 minutes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from bus_schema.authority import AGENT, party_of
from experiments.bench.faults import BACK_AT_MOST, NOISE, QUIET
from experiments.kit.command_line import Progress
from experiments.kit.live.launch import LaunchFailed, stop
from experiments.kit.live.network import FIRST, Faults, Network, inside
from experiments.kit.live.system import Moment, Observer, compare_transitions, stop_after, too_old, violations, wait_for
from mobee.robot.load import load_robot
from services.common.identity import Identity, assume
from services.common.session import open_client

ENDPOINT = f"tls/{FIRST}:7447"
HOST = "second"
AGENTS = ("torso", "left_arm", "right_arm")
LAYOUTS: Mapping[str, tuple[str, ...]] = {"agent": ("agent_left_arm", "monitor"), "control": ("controller", "model", "agent_left_arm")}
"""The services that run on the second host, by the name of the layout; all others run on the first host."""
BEYOND = "left_arm"  # the part whose agent is on the second host
UNDER_WAY = 0.5  # s after the beginning of a cut within which a call of the agent may still arrive
_START, _BACK, _QUIET_TIME = 120.0, 60.0, 1.0  # s
_ALL_SERVICES = ("robot_sim", "model", "controller", "monitor", "recorder", "launcher", f"launcher_{HOST}")


@dataclass(frozen=True, slots=True)
class Fault:
    """A disturbance of the network between the hosts.

    `faults`: what happens to the packets.  `unplugged`: whether the network interface of the second host is off.  `seconds`: duration of
    the disturbance [s]; 0: as in the settings.
    """

    name: str
    faults: Faults = Faults()
    unplugged: bool = False
    seconds: float = 0.0  # 0: as the settings say

    @property
    def cuts(self) -> bool:
        """Whether no packet arrives while the fault lasts."""
        return self.unplugged or self.faults.cut


FAULTS = (
    Fault("delay 50 ms", Faults(delay=0.05)),
    Fault("loss 5 %", Faults(loss=0.05)),
    Fault("reorder 25 %", Faults(delay=0.02, reorder=0.25)),
    Fault("all three", Faults(delay=0.05, loss=0.05, reorder=0.25)),
    Fault("cut", unplugged=True),
    Fault("silent cut", Faults(cut=True)),
    Fault("silent cut, 15 s", Faults(cut=True), seconds=15.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `layouts`: keys of LAYOUTS, which lists the services on the second host.  `faults`: names of disturbances in FAULTS.  `seconds`:
    duration of each disturbance [s].  `rounds`: how often each disturbance is repeated.  `seed`: seed by which packets are lost and
    reordered.
    """

    layouts: tuple[str, ...] = tuple(LAYOUTS)
    faults: tuple[str, ...] = tuple(fault.name for fault in FAULTS)
    seconds: float = 4.0
    rounds: int = 1
    seed: int = 1


QUICK = Settings(faults=("loss 5 %", "cut", "silent cut"), seconds=3.0)


def measure(settings: Settings) -> dict[str, Any]:
    """Disturb the network of a system on two hosts and return the result; raises LaunchFailed if a host or a namespace fails.

    Main keys: "oldest_ms", age of the oldest command that was obeyed [ms]; "back_s", longest time from the end of a disturbance until all
    parts of the robot follow commands and the left arm, whose agent is on the second host, moves [s]; "transitions", dict with numbers of
    transitions: "kept" (on disk), "lost" (published, but not on disk), "differing" (with other values than published) and "repeated" (on
    disk twice, under one number); "broken", list of the broken guarantees as text; "rows", a list with a dict for each disturbance
    ("layout", "fault" and its measurements); "passed", whether no guarantee is broken, no transition is lost, differs or is stored twice,
    and "back_s" is small enough.  If the machine was busy, "back_s" is not judged.
    """
    argv = [sys.executable, "-m", "mobee_system.run", "experiments.bench.network", msgspec.json.encode(asdict(settings)).decode()]
    done = subprocess.run(inside(argv), stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise LaunchFailed(f"the hosts did not run, in network namespaces of this machine: code {done.returncode}, see above")
    return dict(msgspec.json.decode(done.stdout))


def main() -> None:
    """Run the benchmark inside the network namespace in which `measure` has started this process, and print the result as JSON.

    The first command-line argument has the settings, as JSON.  If a host fails, the error is printed and SystemExit(1) is raised.
    """
    settings = msgspec.json.decode(sys.argv[1], type=Settings)
    try:
        result = _measured(settings)
    except LaunchFailed as failed:
        print(f"mobee bench network: {failed}", file=sys.stderr)
        raise SystemExit(1) from None
    sys.stdout.write(msgspec.json.encode(result).decode())


def _measured(settings: Settings) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    kept: dict[str, int] = {"kept": 0, "lost": 0, "differing": 0, "repeated": 0}
    begun = time.monotonic()
    with Progress() as progress:
        for layout in settings.layouts:
            with tempfile.TemporaryDirectory() as scratch, _Hosts(Path(scratch), layout, settings.seed) as hosts:
                chosen = [fault for fault in FAULTS if fault.name in settings.faults] * settings.rounds
                for n, fault in enumerate(chosen):
                    progress.show(n / len(chosen), f"{layout}: {fault.name}")
                    rows.append({"layout": layout, **hosts.disturb(fault, fault.seconds or settings.seconds)})
                for name, count in hosts.compare().items():
                    kept[name] += count
    return _result(settings, rows, kept, time.monotonic() - begun)


class _Hosts:
    """A system on two hosts, and an observer on the first."""

    def __init__(self, folder: Path, layout: str, seed: int) -> None:
        self._folder, self._layout, self._seed = folder, layout, seed
        self._robot, self._observer = load_robot("icub"), Observer()
        self._stack = ExitStack()

    def __enter__(self) -> _Hosts:
        with ExitStack() as failed:
            self._network = failed.enter_context(Network(self._seed))
            self._keys = self._new_keys()
            elsewhere = ",".join(LAYOUTS[self._layout])
            first = ["--elsewhere", elsewhere, "--endpoint", ENDPOINT]
            second = ["--join", ENDPOINT, "--host", HOST, "--only", elsewhere]
            self._first = failed.enter_context(self._launched("first", self._network.on_first(self._command("first", first))))
            wait_for(lambda: self._is_waiting(), _START, "the first host runs")
            self._second = failed.enter_context(self._launched("second", self._network.on_second(self._command("second", second))))
            wait_for(self._is_ready, _START, "all services of both hosts are ready")
            assume(Identity(self._keys, "operator"))
            session = failed.enter_context(open_client(ENDPOINT))
            self._observer.attach(session)
            self._wait_until_back()
            self._stack = failed.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def disturb(self, fault: Fault, seconds: float) -> dict[str, Any]:
        """Disturb the network for `seconds` [s], wait until every part follows commands again, and return what was measured.

        Main keys: "oldest_ms", age of the oldest command that was obeyed [ms]; "held", names of the parts that at some time during the
        fault did not follow commands; "back_s", see `_back`; "broken", list of the broken guarantees as text.
        """
        wait_for(lambda: self._moves(BEYOND), _BACK, f"{BEYOND} moves")
        self._observer.take()
        time.sleep(_QUIET_TIME)
        begin = time.monotonic()
        self._set(fault, True)
        time.sleep(seconds)
        healed = time.monotonic()
        self._set(fault, False)
        broken = list[str]()
        try:
            self._wait_until_back()
        except LaunchFailed as failed:
            broken.append(str(failed))
        time.sleep(_QUIET_TIME)
        self._require_running("first")
        self._require_running("second")
        states, ages = self._observer.take()
        broken += [*too_old(ages), *violations(states, self._robot, NOISE)]
        stops = [found for moments in states.values() if (found := stop_after(moments, begin, healed)) is not None]
        if self._layout == "control" and fault.cuts and any(found.hold is None for found in stops):
            broken.append("a part did not hold although its controller was beyond the cut")
        ended, began = self._ended(begin, healed) if self._layout == "agent" and fault.cuts else (None, False)
        if began:
            broken.append(f"{BEYOND} began an action although its agent was beyond the cut")
        return {
            "fault": fault.name,
            "seconds": seconds,
            "load": os.getloadavg()[0],
            "oldest_ms": 1e3 * max(ages, default=0.0),
            "commands": len(ages),
            "held": sorted(
                part for part, moments in states.items() if any(begin < one.at <= healed and one.gate != "armed" for one in moments)
            ),
            "hold_ms": [1e3 * found.hold for found in stops if found.hold is not None] if self._layout == "control" else [],
            "ended_s": ended,
            "back_s": self._back(states, healed),
            "broken": broken,
        }

    def compare(self) -> dict[str, int]:
        """Compare the published transitions with those on disk, on both hosts, and return their numbers.

        Keys: "kept" (on disk), "lost" (published, but not on disk), "differing" (with other values than published) and "repeated" (on disk
        twice, under one number).
        """
        found = {"kept": 0, "lost": 0, "differing": 0, "repeated": 0}
        beyond = {who.removeprefix(AGENT) for who in LAYOUTS[self._layout] if who.startswith(AGENT)}
        for host, agents in (("first", sorted({*AGENTS} - beyond)), ("second", sorted(beyond))):
            if agents:
                kept = compare_transitions(self._observer, next((self._folder / host).glob("runs/*")), agents)
                for name in found:
                    found[name] += getattr(kept, name)
        return found

    def _set(self, fault: Fault, begins: bool) -> None:
        if fault.unplugged:
            self._network.plug(not begins)
        else:
            self._network.set(fault.faults if begins else Faults())

    def _wait_until_back(self) -> None:
        parts = len(self._robot.parts)
        why = f"every part follows commands, and {BEYOND} moves"
        wait_for(lambda: self._observer.all_armed(parts) and self._moves(BEYOND), _BACK, why)

    def _moves(self, part: str) -> bool:
        """Return whether an action moves a part now."""
        with self._observer.lock:
            changes = self._observer.motions.get(part, [])
            return bool(changes) and changes[-1][1] == "moving"

    def _back(self, states: Mapping[str, list[Moment]], healed: float) -> float:
        """Return the time [s] from the end of the fault until every part followed commands and the agent of BEYOND moved this part.

        BEYOND is the part whose agent is on the second host; if it did not move, the time is at least _BACK.  `states`: the states of each
        part.  `healed`: the monotonic time [s] at which the fault ended.
        """
        held = [moment.at - healed for moments in states.values() for moment in moments if moment.at > healed and moment.gate != "armed"]
        with self._observer.lock:
            changes = list(self._observer.motions.get(BEYOND, []))
        at_end = [change for change in changes if change[0] <= healed]
        after = [change for change in changes if change[0] > healed]
        moved: float | None = 0.0
        if not at_end or at_end[-1][1] != "moving":
            moved = next((change[0] - healed for change in after if change[1] == "moving"), None)
        return max([0.0, *held, _BACK if moved is None else moved])

    def _ended(self, begin: float, healed: float) -> tuple[float | None, bool]:
        """Return when the action of BEYOND (the part whose agent is on the second host) ended during a cut, and whether a new one began.

        The time [s] counts from the beginning of the cut; None if no action ended.  Actions that began within UNDER_WAY (0.5 s) after this
        beginning do not count as new, because their calls may have been sent before.  `begin`, `healed`: beginning and end of the cut.
        """
        with self._observer.lock:
            changes = list(self._observer.motions.get(BEYOND, []))
        during = [change for change in changes if begin < change[0] <= healed]
        ended = next((came - begin for came, status, _ in during if status in ("idle", "settled", "timeout")), None)
        before = {action for came, _, action in changes if came <= begin + UNDER_WAY}
        return ended, any(status == "moving" and action not in before for _, status, action in during)

    def _is_waiting(self) -> bool:
        self._require_running("first")
        return "waits for another host" in self._output("first")

    def _require_running(self, host: str) -> None:
        if (self._first if host == "first" else self._second).poll() is not None:
            raise LaunchFailed(f"the launcher of the {host} host has ended: {' | '.join(self._output(host).splitlines()[-3:])}")

    def _is_ready(self) -> bool:
        self._require_running("first")
        self._require_running("second")
        return "all ready" in self._output("first") and "all ready" in self._output("second")

    def _output(self, host: str) -> str:
        return (self._folder / host / "launcher.err").read_text()

    def _new_keys(self) -> Path:
        from services.common.certificates import KeyFolder

        names = (*_ALL_SERVICES, *(f"{AGENT}{part}" for part in AGENTS), "operator")
        return KeyFolder.new(self._folder / "keys", [("router", None), *((name, party_of(name)) for name in names)]).path

    def _command(self, host: str, options: Sequence[str]) -> list[str]:
        launch = [
            sys.executable,
            "-m",
            "mobee_system",
            "launch",
            "kinematic",
            "--json",
            "--no-record",
            "--secure",
            "--keys",
            str(self._keys),
        ]
        page = ["--page"] if "monitor" in LAYOUTS[self._layout] else ["--headless"]
        return [*launch, *page, "--runs", str(self._folder / host / "runs"), *options]

    @contextmanager
    def _launched(self, host: str, argv: Sequence[str]) -> Iterator[subprocess.Popen[str]]:
        folder = self._folder / host
        folder.mkdir()
        environment = {**os.environ, "XDG_STATE_HOME": str(folder / "state")}
        with (folder / "launcher.err").open("w") as errors:
            process = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=errors, text=True, process_group=0, env=environment)
        try:
            yield process
        finally:
            stop(process)


def _result(settings: Settings, rows: list[dict[str, Any]], kept: dict[str, int], seconds: float) -> dict[str, Any]:
    load = float(np.median([row["load"] for row in rows]))
    broken = [f"{row['layout']}, {row['fault']}: {line}" for row in rows for line in row["broken"]]
    quiet, back = load <= QUIET, max(row["back_s"] for row in rows)
    whole = kept["lost"] == kept["differing"] == kept["repeated"] == 0
    return {
        "seed": settings.seed,
        "seconds": seconds,
        "load": load,
        "oldest_ms": max(row["oldest_ms"] for row in rows),
        "back_s": back,
        "transitions": kept,
        "broken": broken,
        "rows": rows,
        "times_judged": quiet,
        "passed": not broken and whole and (not quiet or back <= BACK_AT_MOST),
    }


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each disturbance, then the broken guarantees."""
    kept = result["transitions"]
    rows = result["rows"]
    lines = [
        f"two hosts, seed {result['seed']}, {len(rows)} faults in {result['seconds']:.0f} s; load of the machine {result['load']:.1f}",
        f"{'beyond':<9}{'fault':<18}{'for s':>6}{'oldest ms':>11}{'hold ms':>9}{'ended s':>9}{'back s':>8}  held",
    ]
    for row in rows:
        hold, ended = _cell(max(row["hold_ms"], default=None), 0), _cell(row["ended_s"], 2)
        lines.append(
            f"{row['layout']:<9}{row['fault']:<18}{row['seconds']:>6.0f}{row['oldest_ms']:>11.0f}{hold:>9}{ended:>9}{row['back_s']:>8.2f}  "
            f"{len(row['held'])} parts"
        )
    lines.append(f"transitions: {kept['kept']} kept, {kept['lost']} lost, {kept['differing']} differ, {kept['repeated']} repeated")
    lines += result["broken"] or ["no promise broken"]
    if not result["times_judged"]:
        lines.append(f"times are not judged: the load was above {QUIET:g}")
    return "\n".join(lines)


def _cell(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


if __name__ == "__main__":
    main()
