# SPDX-License-Identifier: Apache-2.0
"""Runs a scenario: router, services, supervision, stop, summary."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType

from bus_schema import keys
from bus_schema.rpc import Done
from mobee._core import CoreUnavailable, library
from services.common.config import ConfigError, ServiceConfig
from services.common.emergency_stop import BY_LAUNCHER, StopRecord
from services.common.entry import set_up_log
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, INTERRUPTED, OK
from services.common.identity import BadKeys, assume, is_local, secured
from services.common.refusals import RefusalLog
from services.common.rpc import CallFailed
from services.common.service import Service
from services.common.session import (
    DEFAULT_ENDPOINT,
    LEASE,
    LOCAL_ENDPOINT,
    BusUnreachable,
    local_endpoint,
    open_client,
    open_router,
    spare_threads,
)
from services.launcher.catalogue import RECORDER
from services.launcher.checks import (
    MissingExtra,
    PortInUse,
    SystemRuns,
    check_extras,
    check_gains,
    check_lockstep,
    check_ports,
    check_rate,
    check_robots,
    check_services,
)
from services.launcher.child import Program
from services.launcher.run_directory import make_run_directory
from services.launcher.scenario import Scenario, read_scenario
from services.launcher.screen import Screen
from services.launcher.security import LAUNCHER, Refusals, Security
from services.launcher.stops import EmergencyStops
from services.launcher.summary import as_text, summarise
from services.launcher.supervisor import Supervisor

_REDRAW = 0.5  # s
_NO_LIMIT = 1e6  # s
_START_NOTICE = 5.0  # s after all are ready: a run in lockstep that is still at tick 0 is reported


@dataclass(frozen=True)
class Options:
    """Options of `mobee launch`."""

    scenario: str = "default"
    settings: tuple[str, ...] = ()  # table.field=value
    headless: bool = False  # without the monitor
    page: bool = False  # with the monitor, also if the scenario has none
    record: bool = True  # with the recorder, if the scenario has a robot
    cameras: tuple[str, ...] = ()  # on links, see mobee.robot.cameras; with them the renderer starts, also if the scenario has none
    duration: float | None = None  # s after all services are ready; None: until a stop is requested
    ticks: int | None = None  # lockstep: number of ticks after which the run ends
    json: bool = False
    endpoint: str | None = None
    runs: Path = Path("runs")
    keys: Path | None = None  # folder of keys; with it the system is secured
    insecure: bool = False  # an address that other hosts reach is allowed without keys


def launch(options: Options) -> int:
    """Run a scenario to its end; returns the exit code: 0 ok, 1 a service failed for good, 2 bad input, 3 environment, 130 early Ctrl-C."""
    with contextlib.ExitStack() as open_meanwhile:
        return _launch(options, open_meanwhile)


def refused_now(options: Options) -> int:
    """Print why the scenario cannot be started beside what runs now, and return the exit code; 0 if it can."""
    try:
        scenario = _read(options)
        check_ports(scenario, _endpoint(options, scenario))
    except ConfigError as error:
        return _refuse(str(error), BAD_INPUT)
    except (PortInUse, SystemRuns) as error:
        return _refuse(str(error), ENVIRONMENT)
    return OK


def _endpoint(options: Options, scenario: Scenario) -> str:
    endpoint = options.endpoint or str(scenario.shared.get("endpoint", DEFAULT_ENDPOINT))
    return endpoint if options.keys is None else secured(endpoint)


def _launch(options: Options, open_meanwhile: contextlib.ExitStack) -> int:
    started, local = time.monotonic(), ""
    try:
        scenario = _read(options)
        endpoint = _endpoint(options, scenario)
        security = _security(options, scenario, endpoint)
        log = None if security is None else RefusalLog.open()
        library()  # if the core cannot be loaded: one error here instead of one from each service
        check_gains(scenario)
        check_lockstep(scenario)
        robots = check_robots(scenario)
        check_services(scenario, robots)
        check_rate(scenario, robots)
        check_extras(scenario)
        check_ports(scenario, endpoint)
        lease = LEASE
        if scenario.is_locked:
            spare_threads()
            lease = max(part.config.patience for part in scenario.parts)
            local = "" if security else open_meanwhile.enter_context(local_endpoint())  # a socket shows no certificate
        identity, access = (security.router, security.access) if security else (None, None)
        router = open_meanwhile.enter_context(open_router(endpoint, lease, local, identity, access))
        session = open_client(local or endpoint, lease=lease)  # the router itself runs no Python, so that nothing here delays a message
    except ConfigError as error:
        return _refuse(str(error), BAD_INPUT)
    except (CoreUnavailable, MissingExtra, PortInUse, SystemRuns, BusUnreachable, BadKeys) as error:
        return _refuse(str(error), ENVIRONMENT)
    except KeyboardInterrupt:
        return _refuse("interrupted before any service was started", INTERRUPTED)
    try:
        directory = make_run_directory(options.runs, scenario, endpoint)
        record = StopRecord.of_endpoint(endpoint)
        record.create()
        service = Service("launcher", ServiceConfig(endpoint=endpoint), session=session)
        service.log = service.bus.log = set_up_log("launcher", directory / "logs" / "launcher.log")
    except OSError as error:
        return _refuse(
            f"cannot write {error.filename or options.runs}: {error.strerror}; choose another folder of runs with --runs, "
            "or of the record of emergency stops with the variable XDG_STATE_HOME",
            ENVIRONMENT,
        )
    with service, router.liveliness().declare_token(keys.alive("router", service.instance)):
        run = _Run(service, scenario, directory, options, local, security, record)
        if log is not None:
            Refusals(service, log)
        return run.execute(started)


def _security(options: Options, scenario: Scenario, endpoint: str) -> Security | None:
    """Return the keys of a secured launch, and give this process the launcher's; raises ConfigError for an open endpoint without them."""
    if options.keys is None:
        assume(None)
        if not is_local(endpoint):
            if not options.insecure:
                raise ConfigError(
                    f"other hosts can reach {endpoint}: launch with --secure, for which `mobee keys new` makes the keys, or with "
                    "--insecure: then every program that reaches it can move the robot"
                )
            print(f"mobee launch: every program that reaches {endpoint} can move the robot", file=sys.stderr)
        return None
    security = Security(options.keys, scenario)
    assume(security.identity(LAUNCHER))
    if security.expiring:
        print(f"mobee launch: keys expire soon, renew them with `mobee keys add`: {', '.join(security.expiring)}", file=sys.stderr)
    return security


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
        scenario: Scenario,
        directory: Path,
        options: Options,
        local: str,
        security: Security | None,
        record: StopRecord,
    ) -> None:
        """`local`: the address at which the services connect to the router, if not its endpoint; `record`: of emergency stops."""
        self._service, self._scenario, self._directory, self._options = service, scenario, directory, options
        self._screen = Screen(scenario.title or scenario.name)
        self._record = record
        self._stops = EmergencyStops(service, record, self._announce)
        self._supervisor = Supervisor(service, _programs(scenario, directory, local, security), self._stops, self._announce)
        self._children = self._supervisor.children.values()
        self._stop_requested, self._starting = False, True

    def execute(self, started: float) -> int:
        """Start, supervise and stop the services, and report; return the exit code; `started`: monotonic time of the launch [s]."""
        self._handle_signals()
        self._service.describe = self._describe
        self._service.ready()
        ready, duration = self._live(started)
        with contextlib.suppress(OSError):  # one that is left does no harm
            self._record.remove()
        return self._report(ready, duration)

    def _live(self, started: float) -> tuple[float | None, float]:
        """Start, run and stop the services; return the time [s] until all were ready (None: never), and from then to the end."""
        ready = begun = None
        try:
            self._draw()
            self._announce_stop()
            self._supervisor.begin()
            self._spin(_NO_LIMIT, self._supervisor.settled)
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
            self._supervisor.stop()
        finally:
            self._supervisor.kill_all()
            self._screen.draw(self._children, self._directory, last=True)
        return ready, duration

    def _over(self) -> bool:
        """Return whether to end: on request, or because the robot is stopped permanently in a run without a user."""
        lost = self._supervisor.stopped_robot and (self._options.duration is not None or self._starting)
        return self._stop_requested or lost

    def _spin(self, seconds: float, enough: Callable[[], bool] = lambda: False) -> None:
        self._service.spin(time.monotonic() + seconds, lambda: self._over() or enough())

    def _mark(self) -> None:
        """Start the measurement of every service now."""
        waiting: set[str] = set()
        for child in self._children:
            if child.phase == "ready":
                waiting.add(child.who)
                done = partial(_note_marked, waiting, child.who)
                self._service.ask(keys.service_rpc(child.who, "mark"), Done, done, timeout=1.0)
        self._spin(2.0, lambda: not waiting)

    def _ask_final_numbers(self) -> None:
        """Ask for the final numbers: the last ones are up to half a second old."""
        asked = time.monotonic()
        for child in self._children:
            if child.phase == "ready":
                self._supervisor.ask(child)
        self._service.spin(asked + 2.0, lambda: not any(child.asking for child in self._children))

    def _handle_signals(self) -> None:
        """Handle signals: the first one stops the services in order, a second one kills them."""
        self._service.end = self._request_stop

        def on_signal(signum: int, frame: FrameType | None) -> None:
            if self._stop_requested:
                self._supervisor.kill_all()
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
        """Report the stop of an earlier run, or release it if an earlier launcher, which has ended, said it."""
        stop = self._record.read()
        if stop is not None and stop.source == BY_LAUNCHER:
            self._record.release()
        elif stop is not None:
            self._announce(f"the robot is stopped, `mobee estop --reset` releases it: {stop}")

    def _draw(self) -> None:
        self._screen.draw(self._children, self._directory)
        self._service.inbox.at(time.monotonic() + _REDRAW, self._draw)

    def _describe(self) -> tuple[str, dict[str, int]]:
        ready = sum(child.phase == "ready" for child in self._children)
        fault = f", FAULT: {'; '.join(self._supervisor.faults)}" if self._supervisor.faults else ""
        numbers = {f"restarts_{child.who}": child.restarts for child in self._children}
        stop = f", {self._stops.waiting}, not confirmed by robot_sim" if self._stops.waiting else ""
        return f"{self._scenario.name}: {ready} of {len(self._children)} ready{stop}{fault}, {self._directory}"[:2000], numbers

    def _report(self, ready: float | None, duration: float) -> int:
        summary = {
            "scenario": self._scenario.name,
            "run": str(self._directory),
            "duration_s": duration,
            "seconds_to_ready": ready,
            "faults": self._supervisor.faults,
            **summarise(self._children),
        }
        text = json.dumps(summary, indent=2)
        with contextlib.suppress(OSError):  # a full disk does not make the run a failure
            (self._directory / "summary.json").write_text(text + "\n")
        print(text if self._options.json else as_text(summary), flush=True)
        if self._supervisor.bad_settings:
            return BAD_INPUT
        return FAILED if self._supervisor.faults else OK


def _note_marked(waiting: set[str], who: str, answer: Done | CallFailed) -> None:
    waiting.discard(who)


def _programs(scenario: Scenario, directory: Path, local: str, security: Security | None) -> list[Program]:
    return [
        Program(
            who=part.who,
            argv=(sys.executable, "-m", "mobee_system.run", part.entry.module, "--config", str(directory / f"{part.who}.toml")),
            log=directory / "logs" / f"{part.who}.log",
            stage=part.entry.stage,
            after=part.entry.after,
            nice=part.entry.nice,
            vital=part.entry.vital,
            may_end=part.entry.may_end,
            patience=part.config.patience if scenario.is_locked else 0.0,
            environment={
                **({LOCAL_ENDPOINT: local} if local and part.entry.vital else {}),  # nothing waits for the others
                **(security.identity(part.who).environment() if security else {}),
            },
        )
        for part in scenario.parts
    ]
