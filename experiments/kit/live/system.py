# SPDX-License-Identifier: Apache-2.0
"""A live system that runs during a `with` statement, what is observed of it while it is disturbed, and what robot_sim recorded.

The system is launched as a user launches it, and ended as by Ctrl-C.  Observed are the states of its parts, and the transitions that agents
publish and store on disk.  Recorded by robot_sim, the robot simulator, are joint positions of all ticks, and contacts of links with links
or obstacles.
"""

from __future__ import annotations

import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct

from bus_schema import keys
from bus_schema.messages import Motion, State, Tick, Transition
from bus_schema.rpc import Empty, Stat
from experiments.kit.live.launch import LaunchFailed, free_endpoint, launch_command, stop
from experiments.kit.run_folder import read_records
from mobee.arrays import Array
from mobee.robot.robot import Robot
from mobee.store import STORE, TransitionStore
from services.common import rpc
from services.common.emergency_stop import StopRecord
from services.common.observe import Received, listen

MOVES = np.deg2rad(2.0)  # rad/s; a part that is slower is at rest
FRESH = 0.5  # s; an older state says nothing about now
_RECENT = 100  # ticks that are kept, so that the first states after `take` have ages
FACTOR = 1.05  # of the gate's limit: encoders are noisy
OLDEST = 0.1  # s between the beginning of a tick and of the last one in which a command that answers it may be obeyed
POSITIONS, CONTACTS = "q.f64", "contacts.csv"  # as services.robot_sim.watch writes them
MIN_GAP = 0.2  # s without contact of a pair after which its next contact is a new event
COLUMNS = ("k", "pair", "depth")
_START_TIMEOUT = 120.0  # s
_STATES = "state"  # folder of states


@dataclass
class Moment:
    """The state of a part at one tick.

    `run`, `k`: identifier of the run, and number of the tick in it.  `t`: s, simulated time since the start of the run.  `at`: s, monotonic
    time of the machine.  `gate`: state of the gate, the last check of commands before the motors, as "armed".  `mode`: kind of the command
    that the part follows, as "hold".  `age`: age of this command in ticks, counted from the tick with the state from which the command was
    computed; -1: no command.  `q`: measured positions of the part's motors, rad.  `speed`: rad/s, of the fastest motor.
    """

    run: str
    k: int
    t: float
    at: float
    gate: str
    mode: str
    age: int
    q: Array
    speed: float


@dataclass
class Observer:
    """Records the states of all parts, when each tick began, and the transitions that agents publish.

    Attributes:
        parts: states by part, in order of arrival.
        ticks: monotonic time [s] at which a tick began, by run and number.
        motions: by part, a row (time of arrival [s], status, name of the action) for each change of its status or action.
        published: (state, action, state reached, settled, duration) of each transition, by (agent, number of the transition).
        conflicts: a line of text for each transition whose agent had published another one with the same number.
        locked: whether the robot runs in lockstep (every tick waits for all participants).
        lock: held while the other fields change.
    """

    parts: dict[str, list[Moment]] = field(default_factory=dict)
    ticks: dict[tuple[str, int], float] = field(default_factory=dict)
    motions: dict[str, list[tuple[float, str, str]]] = field(default_factory=dict)
    published: dict[tuple[str, int], tuple[Any, ...]] = field(default_factory=dict)
    conflicts: list[str] = field(default_factory=list)
    locked: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def attach(self, session: Any) -> None:
        """Subscribe to the ticks and to the streams of all parts and agents; `session`: a Zenoh session."""
        listen(session, Tick.stream.key(), self._note_tick)
        listen(session, State.stream.keys(), self._note_state)
        listen(session, Motion.stream.keys(), self._note_motion)
        listen(session, Transition.stream.keys(), self._note_transition)

    def _note_tick(self, received: Received) -> None:
        try:
            tick = received.content()
        except ValueError:  # floods have the key of ticks, too
            return
        with self.lock:
            self.ticks[tick["run"], tick["k"]] = 1e-9 * tick["tw"]
            self.locked = tick["mode"] == "lock"

    def _note_state(self, received: Received) -> None:
        state = received.content()
        speed = max(map(abs, state["dq"]), default=0.0)
        moment = Moment(
            state["run"],
            state["k"],
            1e-9 * state["t"],
            1e-9 * state["tw"],
            state["gate"],
            state["mode"],
            state["cmd_age"],
            np.array(state["q"]),
            speed,
        )
        with self.lock:
            self.parts.setdefault(received.key.partition("/")[0], []).append(moment)

    def _note_motion(self, received: Received) -> None:
        motion = received.content()
        with self.lock:
            changes = self.motions.setdefault(received.key.partition("/")[0], [])
            if not changes or changes[-1][1:] != (motion["status"], motion["action_id"]):
                changes.append((received.at, motion["status"], motion["action_id"]))

    def _note_transition(self, received: Received) -> None:
        made = received.content()
        key, values = (made["agent"], made["n"]), tuple(made[name] for name in ("s", "a", "s_next", "settled", "duration"))
        with self.lock:
            if self.published.setdefault(key, values) != values:
                self.conflicts.append(f"{key[0]} published two transitions {key[1]}")

    def newest(self, part: str) -> Moment | None:
        """Return the last state of a part; None if none was received."""
        with self.lock:
            return self.parts[part][-1] if self.parts.get(part) else None

    def all_armed(self, count: int) -> bool:
        """Return whether there are `count` parts, and all are armed (follow commands), by states that are not older than 0.5 s."""
        since = time.monotonic() - FRESH
        with self.lock:
            newest = [states[-1] for states in self.parts.values()]
        return len(newest) == count and all(one.gate == "armed" and one.at > since for one in newest)

    def take(self) -> tuple[dict[str, list[Moment]], list[float]]:
        """Return a dict from the part to its states so far, and the ages [s] of the commands obeyed; keep only the last state of each part.

        If a command was computed from the state of tick m, and the robot obeys it in tick k, then its age is the time between the
        beginnings of ticks m and k.  The returned age is a lower bound, which ends at the beginning of tick k - 1.  Robot_sim publishes
        tick k only after its gate (the last check before the motors) has checked the command of this tick.  On a busy machine much time
        may pass between this check and the message, and it would be counted as age.  A command has no age if tick m or k - 1 was not
        received.
        """
        with self.lock:
            taken, self.parts = self.parts, {part: states[-1:] for part, states in self.parts.items()}
            ticks, self.ticks = self.ticks, dict(list(self.ticks.items())[-_RECENT:])
        obeyed = (one for moments in taken.values() for one in moments if one.mode != "hold" and one.age >= 1)
        spans = ((ticks.get((one.run, one.k - 1)), ticks.get((one.run, one.k - one.age))) for one in obeyed)
        return taken, [before - asked for before, asked in spans if before is not None and asked is not None]


@dataclass(frozen=True)
class Stop:
    """How a part came to rest after a fault.

    `hold`: time [s] from the fault until the part held, that is, followed no command any more; None if it did not hold.  `rest`: time [s]
    from the fault until the holding part was at rest (all motors below 2 deg/s).  `distance`: largest displacement of a motor [rad] between
    the fault and rest.  Both are None if the part did not come to rest in the observed time.
    """

    hold: float | None
    rest: float | None
    distance: float | None


def stop_after(states: list[Moment], fault: float, until: float) -> Stop | None:
    """Return how a part stopped after a fault; None if, when the fault began, the part was not moving under a command.

    `states`: states of the part, in order of time.  `fault`, `until`: monotonic times [s] of the fault and of the end of the observation.
    """
    before = [state for state in states if state.at <= fault]
    if not before or before[-1].gate != "armed" or before[-1].mode == "hold" or before[-1].speed < MOVES:
        return None
    after = [state for state in states if fault < state.at <= until and state.run == before[-1].run]
    held = next((state for state in after if state.mode == "hold"), None)
    rest = next((state for state in after if state.speed < MOVES and held is not None and state.at >= held.at), None)
    distance = None if rest is None else float(np.abs(rest.q - before[-1].q).max())
    return Stop(None if held is None else held.at - fault, None if rest is None else rest.at - fault, distance)


def survived(changes: list[tuple[float, str, str]], fault: float, until: float) -> bool | None:
    """Return whether the action that was under way at the time `fault` has survived until the time `until`; None if there was no action.

    The action has not survived if the part's motion became "held" or "idle", or another action began.  It has survived if it ended with an
    outcome ("settled" or "timeout"), or has not ended yet.  `changes`: changes of the part's motion: time of arrival [s], status, name of
    the action.  `fault`, `until`: monotonic times [s].
    """
    before = [change for change in changes if change[0] <= fault]
    if not before or before[-1][1] != "moving":
        return None
    for _, status, action in (change for change in changes if fault < change[0] <= until):
        if action != before[-1][2] or status in ("held", "idle"):
            return False
        if status in ("settled", "timeout"):
            return True
    return True


def violations(states: Mapping[str, list[Moment]], robot: Robot, noise: float) -> list[str]:
    """Check guarantees of the system in recorded states, and return a line of text for each violation.

    The guarantees: within a run the tick number increases, and no motor is faster than the safety gate of robot_sim allows.  A repeated
    tick 0 is no violation: in lockstep it is repeated until all services have answered.  `states`: states of each part, in order of
    arrival, as `Observer.take` returns them.  `noise`: largest error of the encoders, rad.
    """
    found = []
    for part, moments in states.items():
        limit = np.array([motor.max_velocity for motor in robot.motor_table[robot.part(part).slice]])
        for before, after in zip(moments[:-1], moments[1:], strict=True):
            if before.run != after.run or before.k == after.k == 0:
                continue
            if after.k <= before.k:
                found.append(f"{part}: tick {after.k} after tick {before.k}")
                continue
            excess = np.abs(after.q - before.q) - FACTOR * limit * (after.t - before.t + 0.01) - 2.0 * noise
            if (excess > 0.0).any():
                found.append(f"{part}: {np.rad2deg(excess.max()):.2f} deg too far in {after.t - before.t:.3f} s at tick {after.k}")
    return found


def too_old(ages: Sequence[float]) -> list[str]:
    """Return [a line of text] if the age of a command is above OLDEST (0.1 s), else [].

    `ages`: time [s] of each command from the tick with the state from which it was computed until the robot obeyed it, as `Observer.take`
    returns it.
    """
    oldest = max(ages, default=0.0)
    return [f"a command was obeyed {1e3 * oldest:.0f} ms after the tick that it answers began"] if oldest > OLDEST else []


@dataclass(frozen=True)
class Kept:
    """Counts of the transitions of agents in a store on disk, compared with the published ones.

    `kept`: on disk.  `lost`: published, but not on disk.  `differing`: on disk with other values than published, or published twice with
    different values.  `repeated`: surplus transitions on disk, whose number another transition of the same agent has, too.
    """

    kept: int
    lost: int  # published and not kept
    differing: int  # kept otherwise than published
    repeated: int  # numbers that occur twice on disk


def compare_transitions(observer: Observer, run_dir: Path, agents: list[str]) -> Kept:
    """Compare the transitions that the agents published so far with those in the store of the run, and return the counts.

    `run_dir`: folder of the run.  `agents`: names of the agents whose published transitions are looked up in the store; they may still be
    learning.  Transitions on disk, and those published twice with different values, are counted for all agents.
    """
    with observer.lock:
        published, conflicts = dict(observer.published), len(observer.conflicts)
    kept = lost = differing = repeated = 0
    with TransitionStore(run_dir / STORE, "", read_only=True) as store:
        stored = {agent: store.load(agent) for agent in store.agents()}
    on_disk = {agent: {one.n: (one.s, one.a, one.s_next, one.settled, one.duration) for one in made} for agent, made in stored.items()}
    for agent, made in stored.items():
        kept += len(made)
        repeated += len(made) - len(on_disk[agent])
    for (agent, n), values in published.items():
        if agent in agents:
            found = on_disk.get(agent, {}).get(n)
            lost += found is None
            differing += found is not None and found != values
    return Kept(kept, lost, differing + conflicts, repeated)


class Touch(Struct, frozen=True):
    """A contact event: the time during which two shapes touched, with short interruptions.

    `pair`: names of the shapes.  `begin`, `end`: first and last tick.  `depth`: largest depth, m.
    """

    pair: str
    begin: int  # tick
    end: int  # tick
    depth: float  # m, at its deepest


def read_positions(folder: Path, robot: Robot) -> Array:
    """Read the recorded joint positions at the ends of all ticks, (T, n) rad, from the folder of a recording; row 0 is tick 1."""
    q: Array = np.fromfile(folder / POSITIONS).reshape(-1, len(robot.motors))
    return q


def read_touches(path: Path, dt: float) -> list[Touch]:
    """Read the contact events from the file contacts.csv of a recording, in order of their beginning; `dt`: duration of a tick [s]."""
    rows = ((int(row["k"]), row["pair"], float(row["depth"])) for row in read_records(path, COLUMNS))
    return touches(rows, round(MIN_GAP / dt))


def touches(rows: Iterable[tuple[int, str, float]], gap: int) -> list[Touch]:
    """Group contacts of single ticks into events, and return the events in order of their beginning.

    `rows`: tick, pair of shapes and depth [m] of each contact, in order of the ticks.  `gap`: number of ticks; a contact that comes more
    than `gap` ticks after the last contact of the same pair begins a new event.
    """
    open_: dict[str, Touch] = {}
    found: list[Touch] = []
    for k, pair, depth in rows:
        current = open_.get(pair)
        if current is not None and k - current.end > gap:
            found.append(open_.pop(pair))
            current = None
        open_[pair] = Touch(pair, k, k, depth) if current is None else Touch(pair, current.begin, k, max(current.depth, depth))
    return sorted([*found, *open_.values()], key=lambda touch: (touch.begin, touch.pair))


@dataclass
class System:
    """A running live system: the processes of the robot software, which exchange messages on a bus.

    `process`: the launcher, which starts and supervises all other processes.  `endpoint`: address of the system's Zenoh router.  `folder`:
    contains the folder of the run, the launcher's error output, and the file with the record of the emergency stops.
    """

    process: subprocess.Popen[str]
    endpoint: str
    folder: Path  # of run folders, errors and the record of emergency stops

    @property
    def run_dir(self) -> Path:
        """The folder of the run, into which the system writes its files, such as the transitions of the agents."""
        return next((self.folder / "runs").iterdir())

    @property
    def stop_record(self) -> StopRecord:
        """The record of the system's emergency stops."""
        return StopRecord.of_endpoint(self.endpoint, self.folder / _STATES)

    @property
    def says(self) -> str:
        """The text that the launcher (the process that starts all others) has written to standard error so far."""
        return (self.folder / "launcher.err").read_text()


@contextmanager
def running(folder: Path, scenario: str) -> Iterator[System]:
    """Launch a live system, yield it when all its services are ready, and stop it at the end of the `with` statement.

    `folder`: an empty folder for its files.  `scenario`: name or path of the file that lists its services and their settings; the monitor
    (the service that shows the robot on a web page) does not run.  Raises LaunchFailed.
    """
    endpoint = free_endpoint()
    environment = {**os.environ, "XDG_STATE_HOME": str(folder / _STATES)}
    with (folder / "launcher.err").open("w") as errors:
        argv = launch_command(scenario, endpoint, folder / "runs", ())
        process = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=errors, text=True, process_group=0, env=environment)
    system = System(process, endpoint, folder)
    try:
        wait_for(lambda: "all ready" in system.says or process.poll() is not None, _START_TIMEOUT, "the system is ready")
        if process.poll() is not None:
            raise LaunchFailed(f"{scenario}: ended with code {process.returncode}: {(system.says.splitlines() or ['no message'])[-1]}")
        yield system
    finally:
        stop(process)


def wait_for(condition: Callable[[], Any], timeout: float, what: str, period: float = 0.01) -> Any:
    """Call `condition` every `period` s until it returns a true value, and return this value; raises LaunchFailed after `timeout` s.

    `what`: what was expected, as text for the error message.
    """
    give_up = time.monotonic() + timeout
    while not (value := condition()):
        if time.monotonic() > give_up:
            raise LaunchFailed(f"not within {timeout:g} s: {what}")
        time.sleep(period)
    return value


def stat_of(session: Any, who: str, timeout: float = 0.5) -> Stat | None:
    """Return the status of the service `who`; None if it does not answer within `timeout` s.  `session`: a Zenoh session."""
    try:
        return rpc.call(session, "observer", keys.service_rpc(who, "stat"), Empty, Stat, timeout=timeout)
    except rpc.CallFailed:
        return None
