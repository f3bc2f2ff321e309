# SPDX-License-Identifier: Apache-2.0
"""Runs a scenario: opens the router, starts and supervises the services, stops them, and prints a summary."""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType

import msgspec

from bus_schema import keys
from bus_schema.rpc import Done
from mobee._core import CoreUnavailable, library
from services.common.config import ConfigError, ServiceConfig
from services.common.emergency_stop import BY_LAUNCHER, StopRecord
from services.common.entry import set_up_log
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, INTERRUPTED, OK
from services.common.identity import BadKeys, secured
from services.common.rpc import CallFailed
from services.common.service import Service
from services.common.session import LOCAL_ENDPOINT, BusUnreachable
from services.launcher.catalogue import RECORDER
from services.launcher.checks import (
    MissingExtra,
    PortInUse,
    SystemRuns,
    check_endpoint,
    check_extras,
    check_gains,
    check_lockstep,
    check_ports,
    check_rate,
    check_robots,
    check_services,
)
from services.launcher.child import Program, Watched
from services.launcher.connection import Connection, default_endpoint, join_bus, open_bus
from services.launcher.hosts import JoinRefused, agreement, check_elsewhere, check_names
from services.launcher.remote import SERVICES, Remote, Remotes
from services.launcher.run_directory import make_run_directory
from services.launcher.scenario import Scenario, read_scenario
from services.launcher.screen import Screen
from services.launcher.security import Refusals
from services.launcher.stops import EmergencyStops
from services.launcher.summary import as_text, summarise
from services.launcher.supervisor import Supervisor

_REDRAW = 0.5  # s
_NO_LIMIT = 1e6  # s
_LONGEST_END = 30.0  # s from the end of the services to that of the launcher
_PATIENCE_BEYOND_A_NETWORK = 10.0  # s without an answer after which a service of a joined host, whose router is elsewhere, can be frozen
_JOIN_AGAIN = -1  # in place of an exit code
_START_NOTICE = 5.0  # s after all are ready: a run in lockstep that is still at tick 0 is reported


@dataclass(frozen=True)
class Options:
    """The options of `mobee launch`.

    `scenario`: shipped name or path. `settings`: changes of settings, each "table.field=value". `headless`: do not start the monitor (a web
    page). `page`: start the monitor, even if the scenario does not name it. `record`: start the recorder, if the scenario has a robot.
    `cameras`: cameras on links, each as in `services.common.cameras.CameraConfig.cameras`; with them the renderer starts, even if the
    scenario has none. `duration`: s of real time after all services are ready; None: until the user stops it. `ticks`: in lockstep (every
    tick waits for all participants), number of ticks; None: no limit. `json`: print the summary as JSON. `endpoint`: address of the router;
    None: that of the scenario. `runs`: parent of the run's folder. `keys`: folder of keys; None: not secured. `insecure`: allow an address
    that other hosts reach, without keys. `elsewhere`: services that other hosts start. `join`: address of the first host; None: this host
    is the first. `only`: services that this host starts when it joins. `host`: name of this host when it joins.
    """

    scenario: str = "default"
    settings: tuple[str, ...] = ()
    headless: bool = False
    page: bool = False
    record: bool = True
    cameras: tuple[str, ...] = ()
    duration: float | None = None
    ticks: int | None = None
    json: bool = False
    endpoint: str | None = None
    runs: Path = Path("runs")
    keys: Path | None = None
    insecure: bool = False
    elsewhere: tuple[str, ...] = ()
    join: str | None = None
    only: tuple[str, ...] = ()
    host: str = ""


def launch(options: Options) -> int:
    """Run a scenario to its end and return the exit code.

    0: ended normally; 1: a service was given up; 2: the input is not valid; 3: a fault of the environment, such as a port in use; 130:
    interrupted by Ctrl-C before a service was started. If this launcher has joined the system of another host, and that system is started
    again, this launcher joins the new system.
    """
    while True:
        with contextlib.ExitStack() as open_meanwhile:
            code = _launch(options, open_meanwhile)
        faulthandler.cancel_dump_traceback_later()
        if code != _JOIN_AGAIN:
            return code


def refused_now(options: Options) -> int:
    """Check whether a scenario can be started now: the options are valid, no system runs at its endpoint, and its ports are free.

    If it can be started, return 0; otherwise print the reason and return the exit code.
    """
    try:
        scenario = _read(options)
        endpoint = options.endpoint or default_endpoint(scenario)
        check_endpoint(scenario, endpoint if options.keys is None else secured(endpoint))
        check_ports(scenario)
    except ConfigError as error:
        return _refuse(str(error), BAD_INPUT)
    except (PortInUse, SystemRuns) as error:
        return _refuse(str(error), ENVIRONMENT)
    return OK


def _launch(options: Options, open_meanwhile: contextlib.ExitStack) -> int:
    started = time.monotonic()
    try:
        scenario = _read(options)
        here = _of_this_host(options, scenario)
        library()  # if the core cannot be loaded: one error here instead of one from each service
        check_gains(scenario)
        check_lockstep(scenario)
        robots = check_robots(scenario)
        check_services(here, robots)
        check_rate(scenario, robots)
        check_extras(here)
        if options.join is None:
            endpoint = options.endpoint or default_endpoint(scenario)
            bus = open_bus(scenario, here, endpoint, options.keys, options.insecure, options.elsewhere, open_meanwhile)
        else:
            bus = join_bus(scenario, here, options.join, options.host, options.keys)
    except ConfigError as error:
        return _refuse(str(error), BAD_INPUT)
    except (CoreUnavailable, MissingExtra, PortInUse, SystemRuns, BusUnreachable, BadKeys, JoinRefused) as error:
        return _refuse(str(error), ENVIRONMENT)
    except KeyboardInterrupt:
        return _refuse("interrupted before any service was started", INTERRUPTED)
    open_meanwhile.enter_context(bus.session)  # closed although there is no service, if one of the following files cannot be written
    try:
        directory = make_run_directory(options.runs, here, bus.endpoint, bus.first is None)
        record = _stop_record(bus, scenario, here)
        service = Service(bus.who, ServiceConfig(endpoint=bus.endpoint), session=bus.session)
        service.log = service.bus.log = set_up_log(bus.who, directory / "logs" / f"{bus.who}.log")
    except OSError as error:
        return _refuse(
            f"cannot write {error.filename or options.runs}: {error.strerror}; choose another folder of runs with --runs, "
            "or of the record of emergency stops with the variable XDG_STATE_HOME",
            ENVIRONMENT,
        )
    router = bus.router  # its token ends before the session of the service
    token = contextlib.nullcontext() if router is None else router.liveliness().declare_token(keys.alive("router", service.instance))
    with service, token:
        run = _Run(service, bus, scenario, here, directory, options, record)
        if bus.refusals is not None:
            Refusals(service, bus.refusals)
        return run.execute(started)


def _of_this_host(options: Options, scenario: Scenario) -> Scenario:
    """Return the services that this host starts; raises ConfigError for names that are not in the scenario."""
    if options.join is None:
        check_elsewhere(options.elsewhere, scenario)
        return scenario.only([part.who for part in scenario.parts if part.who not in options.elsewhere])
    check_names("--only", options.only, scenario)
    return scenario.only(options.only)


def _stop_record(bus: Connection, scenario: Scenario, here: Scenario) -> StopRecord | None:
    """Return the record of emergency stops, which is on the host of robot_sim; None if that is another one.  Raises OSError."""
    is_elsewhere = bus.first is not None or any(part.who == "robot_sim" for part in scenario.parts)
    if is_elsewhere and not any(part.who == "robot_sim" for part in here.parts):
        return None
    record = StopRecord.of_endpoint(bus.endpoint)
    record.create()
    return record


def _read(options: Options) -> Scenario:
    """Return the scenario as the options change it; raises ConfigError."""
    settings = list(options.settings)
    if options.ticks:
        settings.append(f"services.robot_sim.ticks={options.ticks}")
    if options.cameras:
        settings.append(f"shared.cameras={json.dumps(options.cameras)}")
    also = ["monitor"] * options.page + ["renderer"] * bool(options.cameras)
    left_out = ["monitor"] * options.headless + [RECORDER] * (not options.record)
    scenario = read_scenario(options.scenario, settings, leave_out=left_out, with_also=also, record=options.record)
    if options.cameras and scenario.is_locked:
        raise ConfigError(
            "--camera: pictures depend on real time, so that there are none in lockstep: leave it out, or launch without lockstep"
        )
    return scenario


def _refuse(text: str, code: int) -> int:
    print(f"mobee launch: {' '.join(text.split())}", file=sys.stderr)
    return code


class _Run:
    """The state of one run, in the launcher's main thread."""

    def __init__(
        self,
        service: Service,
        bus: Connection,
        scenario: Scenario,
        here: Scenario,
        directory: Path,
        options: Options,
        record: StopRecord | None,
    ) -> None:
        """`scenario`: all services; `here`: those of this host; `record`: of emergency stops, None if it is on another host."""
        self._service, self._bus, self._scenario, self._directory, self._options = service, bus, scenario, directory, options
        self._screen = Screen(scenario.title or scenario.name)
        self._record = record
        self._stops = EmergencyStops(service, record, self._announce)
        first = bus.first
        elsewhere = {part.who: part.entry.vital for part in scenario.parts if part not in here.parts}
        self._remotes = Remotes(service, elsewhere, self._announce, self._give_up) if first is None else Remotes(service, elsewhere)
        self._supervisor = Supervisor(
            service,
            _programs(here, directory, bus),
            self._stops,
            self._announce,
            held=service.instance if first is None else f"{first.instance} {os.getpid()}",
            elsewhere=self._remotes.services,
            is_reachable=lambda: first is None or first.instance in service.alive.get("router", ()),
        )
        self._children = self._supervisor.children.values()
        self._judged: Sequence[Remote] = list(self._remotes.services.values()) if first is None else ()
        self._shown: Sequence[Watched] = [*self._children, *self._judged]
        self._stop_requested, self._starting, self._join_again = False, True, False
        self._is_killing = False  # by a second signal
        if first is None:
            text = msgspec.json.encode(agreement(scenario, service.instance, options.elsewhere))
            service.configuration = lambda: text
            service.words = lambda: {f"host_{remote.who}": remote.host for remote in self._judged if remote.host}
        else:
            service.words = lambda: {SERVICES: " ".join(child.who for child in self._children)}
            service.on_new_system = self._note_new_system
            service.on_alive(self._note_router)

    def execute(self, started: float) -> int:
        """Start, supervise and stop the services, and report; return the exit code.

        `started`: monotonic time at which the launch began [s].
        """
        self._handle_signals()
        self._service.describe = self._describe
        self._service.ready()
        ready, duration = self._live(started)
        if sys.__stderr__ is not None:  # nobody supervises the launcher: if its sessions do not close, it ends and shows where it waits
            faulthandler.dump_traceback_later(_LONGEST_END, exit=True, file=sys.__stderr__)
        with contextlib.suppress(OSError):  # one that is left does no harm
            if self._record is not None:
                self._record.remove()
        return self._report(ready, duration)

    def _live(self, started: float) -> tuple[float | None, float]:
        """Start, run and stop the services; return the time [s] until all were ready (None: never), and from then to the end."""
        ready = begun = None
        try:
            self._draw()
            self._announce_stop()
            if self._judged:
                self._announce(self._how_to_join())
            self._remotes.begin()
            self._supervisor.begin()
            self._spin(_NO_LIMIT, self._is_settled)
            if not self._over():
                self._starting = False
                ready = time.monotonic() - started
                self._announce(
                    "running without the services that were given up" if self._supervisor.faults else f"all ready after {ready:.1f} s"
                )
                if not self._scenario.is_locked:  # in lockstep all services count from tick 1 on, so that no number depends on real time
                    self._mark()
                else:
                    self._service.inbox.at(time.monotonic() + _START_NOTICE, self._announce_start)
                begun = time.monotonic()
                self._spin(self._options.duration or _NO_LIMIT, self._supervisor.has_arrived)
                self._ask_final_numbers()
            duration = 0.0 if begun is None else time.monotonic() - begun
            self._announce("stopping")
            if self._bus.first is None:
                self._remotes.end_hosts()
            self._supervisor.stop()
        finally:
            self._supervisor.kill_all()
            self._screen.draw(self._shown, self._directory, last=True)
        return ready, duration

    def _is_settled(self) -> bool:
        return self._supervisor.settled() and all(remote.phase in ("ready", "fault") for remote in self._judged)

    def _over(self) -> bool:
        """Return whether to end: on request, or because the robot is stopped permanently in a run without a user."""
        lost = self._supervisor.stopped_robot and (self._options.duration is not None or self._starting)
        return self._stop_requested or lost

    def _spin(self, seconds: float, enough: Callable[[], bool] = lambda: False) -> None:
        self._service.spin(time.monotonic() + seconds, lambda: self._over() or enough())

    def _mark(self) -> None:
        """Let all ready services begin to count for the measurements of the run, and wait up to 2 s for their answers.

        On a host that has joined the system of another host this does nothing: the launcher of the first host does it for all services.
        """
        waiting: set[str] = set()
        for child in self._shown if self._bus.first is None else ():
            if child.phase == "ready":
                waiting.add(child.who)
                done = partial(_note_marked, waiting, child.who)
                self._service.ask(keys.service_rpc(child.who, "mark"), Done, done, timeout=1.0)
        self._spin(2.0, lambda: not waiting)

    def _ask_final_numbers(self) -> None:
        """Ask all services for their statistics once more, at the end of the run: the last replies are up to half a second old."""
        asked = time.monotonic()
        for child in self._children:
            if child.phase == "ready":
                self._supervisor.ask(child)
        for remote in self._judged:
            if remote.phase == "ready":
                self._remotes.ask(remote)
        self._service.spin(asked + 2.0, lambda: not self._is_asking())

    def _is_asking(self) -> bool:
        return any(child.asking for child in self._children) or any(remote.asking for remote in self._judged)

    def _give_up(self, remote: Remote) -> None:
        self._supervisor.report_fault(f"{remote.who} {remote.reason}", remote.vital)

    def _how_to_join(self) -> str:
        names = ",".join(remote.who for remote in self._judged)
        options = f"--only {names} --join ADDRESS{' --secure' if self._bus.security else ''}"
        return f"waits for another host to start {names}, with `mobee launch {self._options.scenario} {options}`"

    def _note_router(self, who: str, instance: str, up: bool) -> None:
        """Report whether the router of the first host is reachable, if this host has joined a system that runs there."""
        if self._bus.first is None or who != "router" or instance != self._bus.first.instance:
            return
        if up:
            self._announce(f"connected with the router at {self._bus.endpoint}")
        elif not self._stop_requested:
            self._announce(f"the router at {self._bus.endpoint} is not reachable: the services of this host wait for it")

    def _note_new_system(self) -> None:
        """End the services of this host, so that it joins again: the system of the first host, which it had joined, was started again."""
        self._announce(f"the system at {self._bus.endpoint} was started again: this host joins it")
        self._join_again = True
        self._request_stop()

    def _handle_signals(self) -> None:
        """Handle signals: the first one stops the services in order, a second one kills them, and later ones do nothing."""
        self._service.end = self._request_stop

        def on_signal(signum: int, frame: FrameType | None) -> None:
            if self._is_killing:
                return
            if self._stop_requested:
                # `_live` kills them when it ends. Here this thread could wait for a lock of `Popen` that it holds itself.
                self._is_killing = True
                raise SystemExit(FAILED)
            self._request_stop()

        for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(signum) is not signal.SIG_IGN:  # keep the effect of nohup
                signal.signal(signum, on_signal)

    def _request_stop(self) -> None:
        self._stop_requested = True
        self._service.inbox.put(lambda: None)  # wake the main thread

    def _announce(self, text: str) -> None:
        self._service.log.info("%s", text)
        self._screen.add(text)

    def _announce_start(self) -> None:
        sim = self._supervisor.children.get("robot_sim")
        if not self._over() and sim is not None and sim.stat is not None and sim.stat.numbers.get("tick") == 0.0:
            self._announce(f"robot_sim is still at tick 0: {sim.stat.text}")

    def _announce_stop(self) -> None:
        """Handle an emergency stop that an earlier run has recorded: report it to the user, or release it.

        It is released only if the launcher of that run, which has ended, had sent it.
        """
        stop = None if self._record is None else self._record.read()
        if self._record is not None and stop is not None and stop.source == BY_LAUNCHER:
            self._record.release()
        elif stop is not None:
            self._announce(f"the robot is stopped, `mobee estop --reset` releases it: {stop}")

    def _draw(self) -> None:
        self._screen.draw(self._shown, self._directory)
        self._service.inbox.at(time.monotonic() + _REDRAW, self._draw)

    def _describe(self) -> tuple[str, dict[str, int]]:
        ready = sum(child.phase == "ready" for child in self._shown)
        fault = f", FAULT: {'; '.join(self._supervisor.faults)}" if self._supervisor.faults else ""
        numbers = {f"restarts_{child.who}": child.restarts for child in self._shown}
        stop = f", {self._stops.waiting}, not confirmed by robot_sim" if self._stops.waiting else ""
        return f"{self._scenario.name}: {ready} of {len(self._shown)} ready{stop}{fault}, {self._directory}"[:2000], numbers

    def _report(self, ready: float | None, duration: float) -> int:
        summary = {
            "scenario": self._scenario.name,
            "run": str(self._directory),
            "duration_s": duration,
            "seconds_to_ready": ready,
            "faults": self._supervisor.faults,
            **summarise(self._shown),
        }
        text = json.dumps(summary, indent=2)
        with contextlib.suppress(OSError):  # a full disk does not make the run a failure
            (self._directory / "summary.json").write_text(text + "\n")
        if self._join_again:
            return _JOIN_AGAIN
        print(text if self._options.json else as_text(summary), flush=True)
        if self._supervisor.bad_settings:
            return BAD_INPUT
        return FAILED if self._supervisor.faults else OK


def _note_marked(waiting: set[str], who: str, answer: Done | CallFailed) -> None:
    waiting.discard(who)


def _programs(here: Scenario, directory: Path, bus: Connection) -> list[Program]:
    patience = 0.0 if bus.first is None else _PATIENCE_BEYOND_A_NETWORK
    return [
        Program(
            who=part.who,
            argv=(sys.executable, "-m", "mobee_system.run", part.entry.module, "--config", str(directory / f"{part.who}.toml")),
            log=directory / "logs" / f"{part.who}.log",
            stage=part.entry.stage,
            after=part.entry.after,
            nice=part.entry.nice,
            vital=part.entry.vital,
            standby=part.entry.has_standby,
            may_end=part.entry.may_end,
            patience=part.config.patience if here.is_locked else patience,
            environment={
                **({LOCAL_ENDPOINT: bus.local} if bus.local and part.entry.vital else {}),  # nothing waits for the others
                **(bus.security.identity(part.who).environment() if bus.security else {}),
            },
        )
        for part in here.parts
    ]
