# SPDX-License-Identifier: Apache-2.0
"""The life cycle of a service: opens the session, answers calls, declares a liveliness token, ends quickly in every state."""

from __future__ import annotations

import ctypes
import gc
import math
import os
import secrets
import signal
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import cache, partial
from numbers import Integral
from types import FrameType, TracebackType
from typing import Self, TypeVar

import msgspec
import zenoh

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.rpc import Config, Done, Empty, Pulse, Reply, Request, Stat
from mobee.errors import MobeeError
from mobee.robot.robot import Robot
from services.common import rpc
from services.common.bus import Bus
from services.common.config import ServiceConfig, load_config
from services.common.entry import explained, robot_of, set_up_log, wait_until_released
from services.common.exit_codes import ENVIRONMENT, OK
from services.common.health import WINDOW
from services.common.inbox import CROWDED_WITH_CALLS, Inbox
from services.common.listener import Listener
from services.common.rate import NOT_MEASURED
from services.common.rpc import Answering
from services.common.rpc import CallRefused as CallRefused
from services.common.session import LEASE, LOCAL_ENDPOINT, end_unreceived, open_client, spare_threads

_Q = TypeVar("_Q", bound=Request)
_R = TypeVar("_R", bound=Reply)
_C = TypeVar("_C", bound=ServiceConfig)

ORPHANED = 10.0  # s without a router after which a service ends
WARNING_PERIOD = 10.0  # s between two events about second tokens of a router, of which a sender may invent any number
BUSY = 3.0  # s between two checks for the router in which a service has computed instead of handling messages, such as the router's token
ONLY_ONE = ("robot_sim", "model", "controller", "port_filter")  # two would both be obeyed
FRESH_STATS, STATS_PERIOD = 10, 0.2  # of so many answers to `stat` within so many s each is computed; others repeat the last one


class Service(Listener):
    """A process on the bus. All handlers run one after the other, in the main thread, inside `spin` or `run`.

    Exception: if a service was made with `prompt` = True, its handlers run in Zenoh's thread in lockstep while it is in `run`. That thread
    must not wait, so these handlers must not use `call`.
    """

    def __init__(
        self,
        who: str,
        config: ServiceConfig,
        robot: Robot | None = None,
        session: zenoh.Session | None = None,
        inbox: Inbox | None = None,
        prompt: bool = False,
    ) -> None:
        """Connect to the router.

        Args:
            who: name of the service.
            config: its settings.
            robot: the robot, from which the lengths of vectors in messages are checked; None: they are not checked.
            session: an open session to use; None: open a new one.
            inbox: the inbox of another service in the same process, to share it; None: make a new one.
            prompt: True for a service for which every tick waits, and whose handlers never compute for long: Zenoh's own thread puts
                messages into the inbox and, in lockstep, handles them.
        """
        self.who, self.config, self.instance = who, config, f"i{os.getpid()}_{secrets.token_hex(3)}"
        self._signalled = False
        signal.signal(signal.SIGTERM, self._end)
        signal.signal(signal.SIGINT, self._end)
        self.log = set_up_log(who)
        if config.mode == "lock":
            spare_threads()
        lease = config.patience if config.mode == "lock" else LEASE
        held = wait_until_released() if session is None else ()
        self._launcher = held[0] if held else ""  # instance of the one that has the router
        self._parent = int(held[1]) if held[1:] else 0  # process id of the own launcher, if that has joined from another host
        self._lease = lease
        session = session or self._open_session()
        with ExitStack() as failed:
            failed.enter_context(session)  # closes it: an open callback would keep the interpreter from exiting
            failed.callback(rpc.flush, session, self.who)
            self._begin(session, robot, inbox or Inbox(), prompt)
            self._sessions = failed.pop_all()

    def _open_session(self) -> zenoh.Session:
        config = self.config
        return open_client(os.environ.get(LOCAL_ENDPOINT) or config.endpoint, namespace=config.namespace, lease=self._lease)

    def second_session(self) -> zenoh.Session:
        """Open another session with the router, for a stream that must not wait behind others; the session is closed with the service."""
        session = self._sessions.enter_context(self._open_session())
        self._sessions.callback(rpc.flush, session, self.who)
        return session

    def _begin(self, session: zenoh.Session, robot: Robot | None, inbox: Inbox, prompt: bool) -> None:
        locked = self.config.mode == "lock"
        self._serves = prompt and locked
        super().__init__(Bus(session, self.who, self.log), inbox, locked, direct=prompt or locked)
        self.patience = rpc.LOCKED_TIMEOUT if self.locked else rpc.TIMEOUT  # s that a call waits for its answer
        if robot is not None:
            self.bus.robot_size = len(robot.motors)
            self.bus.part_sizes = {name: len(part) for name, part in robot.parts.items()}
        self.alive: dict[str, set[str]] = {}
        self.started = time.monotonic()
        self.describe: Callable[[], tuple[str, Mapping[str, float]]] = lambda: ("", {})
        self.words: Callable[[], Mapping[str, str]] = dict  # of `stat`: values that are not numbers
        self.configuration: Callable[[], bytes] = lambda: msgspec.json.encode(self.config)  # JSON, the answer to `config`
        self.mark: Callable[[], None] = lambda: None  # called at the start of a measurement: sets the counters of `describe` to 0
        self.end: Callable[[], None] = _leave  # called after a shutdown call
        self.on_new_system: Callable[[], None] = _leave_old_system  # called when another launcher or router answers
        self._answering = Answering(self.bus)
        self._stats: deque[float] = deque([0.0] * FRESH_STATS, FRESH_STATS)  # monotonic times of the newest answers that were computed
        self._last_stat: Stat | None = None
        self._on_alive: list[Callable[[str, str, bool], None]] = []
        self._is_ready = False
        inbox.at(time.monotonic() + WINDOW, self._check_health)
        self._router_checked = time.monotonic()
        self._router, self._router_seen = self._launcher, self._router_checked  # a launcher is the router of those it has started
        self._strays: set[str] = set()  # tokens of routers that no process has
        self._is_asking, self._next_warning = False, 0.0  # which router answers; monotonic clock
        self._watch_liveliness()
        self.on_request(keys.service_rpc(self.who, "stat"), Empty, self._stat)
        self._kept.append(session.declare_queryable(keys.service_rpc(self.who, "pulse"), self._answer_pulse))
        self.on_request(keys.service_rpc(self.who, "mark"), Empty, self._mark)
        self.on_request(keys.service_rpc(self.who, "config"), Empty, self._config)
        self.on_request(keys.service_rpc(self.who, "shutdown"), Empty, self._shutdown)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with self._sessions:  # closes them even if a signal comes in between: an open callback would keep the interpreter from exiting
            _ignore_signals()
            if error is not None and not isinstance(error, SystemExit) and not self._is_explained(error):
                self.log.error("ended by %s", error, exc_info=error)

    def _is_explained(self, error: BaseException) -> bool:
        """Return whether the error's text without a traceback is enough for a user; an InvalidValue after the start is a defect."""
        return type(error) is MobeeError or (isinstance(error, MobeeError) and not self._is_ready)

    def on_alive(self, handler: Callable[[str, str, bool], None]) -> None:
        """Call `handler(service, instance, up)` when the liveliness token of a process appears (`up`: True) or disappears (`up`: False).

        `service`: name of the process. `instance`: its id, which no other process has.
        """
        self._on_alive.append(handler)

    def on_request(self, key: str, cls: type[_Q], handler: Callable[[_Q, str], Reply], part_of_key: bool = False) -> None:
        """Answer calls of `key` with the reply that handler(request, key) returns.

        `cls`: type of the requests. The handler may raise CallRefused: the caller then receives its code and text. `part_of_key`: True: the
        key begins with the name of a part. A request is then refused if a vector of it for the motors of a part has another number of
        entries than this part has motors.
        """

        def enqueue(query: zenoh.Query) -> None:
            self.inbox.offer(lambda: self._answering.answer(query, key, cls, handler, part_of_key), CROWDED_WITH_CALLS)

        self._kept.append(self.bus.session.declare_queryable(key, enqueue))

    def call(
        self, key: str, request: type[Request], reply: type[_R], *, timeout: float | None = None, tries: int = 1, **fields: object
    ) -> _R:
        """Call another service, wait for the reply and return it; raises services.common.rpc.CallFailed if there is no valid reply.

        `key`: key of the call on the bus (`bus_schema.keys`). `request`, `reply`: types of request and reply. `fields`: fields of the
        request. `timeout`: time for each try, s; None: 0.5 s, in lockstep 1.5 s. `tries`: how many times the call is sent while there is no
        answer; the call takes effect at most once.
        """
        return rpc.call(self.bus.session, self.who, key, request, reply, timeout=timeout or self.patience, tries=tries, **fields)

    def ask(
        self,
        key: str,
        reply: type[_R],
        done: Callable[[_R | rpc.CallFailed], None],
        *,
        request: type[Request] = Empty,
        timeout: float = rpc.TIMEOUT,
        wanted: Callable[[_R], bool] | None = None,
        **fields: object,
    ) -> None:
        """Call another service without waiting; later, `done` is called in the main thread with the reply or with a CallFailed.

        `key`: key of the call on the bus (`bus_schema.keys`). `request`, `reply`: types of request and reply. `fields`: fields of the
        request. `timeout`: s. `wanted`: if several processes may answer, a function that returns True for the reply to use; if it is True
        for none, `done` gets the first.
        """

        def enqueue(answer: _R | rpc.CallFailed) -> None:
            self.inbox.put(lambda: self.bus.guarded(f"the answer to {key}", lambda: done(answer)))

        rpc.ask(self.bus.session, self.who, key, reply, enqueue, request=request, timeout=timeout, wanted=wanted, **fields)

    def ready(self) -> None:
        """Declare the liveliness token of this service; call this after all subscriptions and calls are declared.

        Only one process of each of the services robot_sim, model, controller and port_filter may run, because others would follow the
        messages of both. If this is one of these services and no launcher has started it, the method first asks whether another process of
        the same name is ready. If so, it raises SystemExit.
        """
        if self.who in ONLY_ONE and not self._launcher:
            self._require_no_other()
        gc.collect()
        gc.freeze()  # objects that live as long as the process: a full collection of them would delay a tick
        return_free_memory()
        self._is_ready = True
        self._kept.append(self.bus.session.liveliness().declare_token(keys.alive(self.who, self.instance)))
        self.log.info("ready as %s", self.instance)

    def _require_no_other(self) -> None:
        def is_other(stat: Stat) -> bool:
            return stat.instance != self.instance and stat.ready

        answers: list[Stat | rpc.CallFailed] = []
        self.ask(keys.service_rpc(self.who, "stat"), Stat, answers.append, wanted=is_other)
        self.spin(time.monotonic() + 2.0 * rpc.TIMEOUT, lambda: bool(answers))
        if answers and isinstance(answers[0], Stat) and is_other(answers[0]):
            where, pid = self.config.endpoint, answers[0].pid
            self.log.error("%s runs already at %s (process %d), and two would both be obeyed: this one ends", self.who, where, pid)
            raise SystemExit(ENVIRONMENT)

    def spin(self, until: float, enough: Callable[[], bool] | None = None) -> None:
        """Run handlers until the time `until` [s] of the monotonic clock, or until `enough` returns True."""
        self.inbox.spin(until, enough)

    def run(self) -> None:
        """Run handlers until SystemExit is raised: by a signal, a shutdown call, or `check_router`.

        The last happens when the router, or the launcher that has started this service, has been missing for 10 s.
        """
        spin = self.inbox.serve if self._serves else self.inbox.spin
        while True:
            spin(time.monotonic() + 1.0)
            self.check_router()

    def _end(self, signum: int, frame: FrameType | None) -> None:
        _ignore_signals()  # a second one must not interrupt the end
        self._signalled = True
        raise SystemExit(OK)

    def check_router(self) -> None:
        """Raise SystemExit if this service has been without a router, or without its own launcher, for ORPHANED (10 s).

        SystemExit is also raised if the handler of an earlier SIGTERM or SIGINT raised it, but other code caught or ignored it. `run`
        calls this every second; a loop that does not use `run` must call it too.
        """
        if self._signalled:
            raise SystemExit(OK)
        end_unreceived(self.config.endpoint, self._lease)  # also of a connection that has taken the place of another one
        missing, now = self._missing(), time.monotonic()
        unhandled, self._router_checked = now - self._router_checked > BUSY, now
        if not missing or unhandled:
            self._router_seen = now
        elif now - self._router_seen > ORPHANED:
            self.log.error(
                "no %s at %s for %g s: this service ends; start the system again with `mobee launch`",
                missing,
                self.config.endpoint,
                ORPHANED,
            )
            raise SystemExit(ENVIRONMENT)

    def _missing(self) -> str:
        """Return the name of the process that this service needs and does not see; empty if it sees it.

        On a host that has joined, the launcher of that host decides: the router may be beyond a cut of the network for any time.
        """
        if self._parent:
            return "" if os.getppid() == self._parent else "launcher"
        return "" if self._router in self.alive.get("router", ()) else "router"

    def _watch_liveliness(self) -> None:
        def enqueue(sample: zenoh.Sample) -> None:
            _, who, instance = str(sample.key_expr).split("/")
            up = sample.kind == zenoh.SampleKind.PUT
            self.inbox.put(lambda: self._note_alive(who, instance, up))

        liveliness = self.bus.session.liveliness()
        self._kept.append(liveliness.declare_subscriber(keys.ALL_ALIVE, enqueue, history=True))

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        instances = self.alive.setdefault(who, set())
        (instances.add if up else instances.discard)(instance)
        if not up:
            self._strays.discard(instance)
        if who == "router" and up:
            self._join(instance)
        for handler in self._on_alive:
            handler(who, instance, up)

    def _join(self, router: str) -> None:
        """Record the id of the router whose presence is on the bus; if a second id appears, start calls that show which router is alive.

        A service stays in the system in which it started: it must not join one whose router started later.
        """
        if not self._router:
            self._router = router
        elif router != self._router:
            if (now := time.monotonic()) > self._next_warning:
                self._next_warning = now + WARNING_PERIOD
                self.bus.event("warning", "two_routers", f"a second token of a router, {router}, is on the bus beside {self._router}")
            if not self._is_asking:
                self._ask_router()

    def _ask_router(self) -> None:
        """Call launcher and router for their status, to find out whether a router of another system is alive.

        Other routers are seen by their tokens (presence signals) on the bus. A token may also be left of a router that has ended. The calls
        are repeated once a second while there are tokens of other routers, except those that are known to be left over. `_check_system`
        handles the answers.
        """
        others = self.alive["router"] - self._strays - {self._router}
        self._is_asking = bool(others)
        if not others:
            return
        for who in ("launcher", "router"):
            self.ask(keys.service_rpc(who, "stat"), Stat, partial(self._check_system, who, others))
        self.inbox.at(time.monotonic() + 1.0, self._ask_router)

    def _check_system(self, who: str, others: set[str], answer: Stat | rpc.CallFailed) -> None:
        """Call `on_new_system`, which ends a service, if a launcher or router of another system answers a `stat` call.

        `who`: "launcher" or "router". `others`: presence tokens of other routers that were on the bus at the call. If the router of this
        service's system answers, these tokens belong to no process and are ignored from now on.
        """
        if not isinstance(answer, Stat) or self.who == who:
            return
        if answer.instance != self._router:
            self.log.error("another %s answers at %s: the system of this process has ended", who, self.config.endpoint)
            self.on_new_system()
            return
        self._strays |= others & self.alive["router"]

    def _check_health(self) -> None:
        refused, waiting = self.bus.rejected.total() + self.inbox.dropped, self.inbox.waiting()
        self.health.check(self.expected_rate, refused, waiting, lambda level, text: self.bus.event(level, "health", f"{self.who} {text}"))
        self.inbox.at(time.monotonic() + WINDOW, self._check_health)

    def _stat(self, request: Empty, key: str) -> Stat:
        now = time.monotonic()
        if self._last_stat is None or now - self._stats[0] > STATS_PERIOD:
            self._last_stat = self._new_stat()
            self._stats.append(now)
        return self._last_stat

    def _new_stat(self) -> Stat:
        text, numbers = self.describe()
        return Stat(
            v=VERSION,
            who=self.who,
            instance=self.instance,
            pid=os.getpid(),
            uptime=time.monotonic() - self.started,
            ready=self._is_ready,
            text=text,
            numbers={name: _measured(value) for name, value in numbers.items()},
            words=dict(self.words()),
            health=self.health.numbers(self.inbox.waiting()),
            warnings=sorted(self.health.bad),
            rejected={**self.bus.rejected, **({"flood": self.inbox.dropped} if self.inbox.dropped else {})},
        )

    def _answer_pulse(self, query: zenoh.Query) -> None:
        """Answer the launcher's query for a pulse: how many messages the inbox has handled, and how many wait.

        It runs on a thread of Zenoh, so it answers also if the main thread is busy. So the launcher sees whether the inbox advances.
        """
        pulse = Pulse(v=VERSION, handled=self.inbox.handled, waiting=self.inbox.waiting())
        with query:
            query.reply(query.key_expr, encode(pulse), encoding=encoding_of(Pulse))

    def _mark(self, request: Empty, key: str) -> Done:
        self.bus.rejected.clear()
        self.inbox.dropped, self._last_stat = 0, None
        self.mark()
        return Done(v=VERSION)

    def _config(self, request: Empty, key: str) -> Config:
        return Config(v=VERSION, config=self.configuration().decode())

    def _shutdown(self, request: Empty, key: str) -> Done:
        self.log.info("%s requested the end", request.who)
        self.inbox.at(time.monotonic() + 0.05, self.end)  # after the reply was sent
        return Done(v=VERSION)


def _measured(value: float) -> int | float | None:
    """Return a status number of a service's `describe` for a message: int or float; None if it was not measured or is not finite."""
    if value == NOT_MEASURED or not math.isfinite(value):
        return None
    return int(value) if isinstance(value, Integral) else float(value)


def return_free_memory() -> None:
    """Return unused memory of this process to the system, if the C library can do so.

    After the start of a service that has read meshes, about 23 MB are returned.
    """
    trim = _malloc_trim()
    if trim is not None:
        trim(0)


@cache
def _malloc_trim() -> Callable[[int], int] | None:
    """Return glibc's function malloc_trim, which returns unused memory to the system; None with another C library.

    The result is cached, since each `ctypes.CDLL` creates classes whose memory only a full garbage collection frees.
    """
    return getattr(ctypes.CDLL(None), "malloc_trim", None)


def _leave() -> None:
    raise SystemExit(OK)


def _leave_old_system() -> None:
    raise SystemExit(ENVIRONMENT)


def _ignore_signals() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def run_node(
    module: str,
    config_class: type[_C],
    node: Callable[[Service, _C, Robot], object],
    argv: Sequence[str] | None = None,
    prompt: bool = False,
) -> None:
    """Read the settings, load the robot, create a service and its node, and run the service until a signal or a shutdown call.

    Args:
        module: dotted name of the program, such as "services.model"; its last word is the name of the service.
        config_class: type of the settings.
        node: called as node(service, config, robot); creates the node, that is, the object whose handlers the service runs.
        argv: command line without the program's name; None: that of this process.
        prompt: True for a service for which every tick waits, and whose handlers never compute for long. In lockstep its handlers then run
            in the thread that receives the messages, which saves time.
    """
    config = load_config(config_class, argv, module)
    with explained(module):
        robot = robot_of(config)
        with Service(module.rpartition(".")[2], config, robot, prompt=prompt) as service:
            node(service, config, robot)
            service.ready()
            service.run()
