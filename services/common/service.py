"""The life cycle of a service: session, calls, liveliness, and a quick end from every state."""

from __future__ import annotations

import ctypes
import gc
import os
import secrets
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from types import FrameType, TracebackType
from typing import Self, TypeVar

import msgspec
import zenoh

from bus_schema import VERSION, keys
from bus_schema.rpc import Config, Done, Empty, Reply, Request, Stat
from mobee.errors import MobeeError
from mobee.robot.robot import Robot
from services.common import rpc
from services.common.bus import Bus
from services.common.config import ServiceConfig
from services.common.entry import set_up_log, wait_until_released
from services.common.exit_codes import ENVIRONMENT, OK
from services.common.inbox import CROWDED_WITH_CALLS, Inbox
from services.common.listener import Listener
from services.common.rpc import Answering
from services.common.rpc import CallRefused as CallRefused
from services.common.session import LEASE, LOCAL_ENDPOINT, open_client, spare_threads

_Q = TypeVar("_Q", bound=Request)
_R = TypeVar("_R", bound=Reply)

ORPHANED = 10.0  # s without a router after which a service ends


class Service(Listener):
    """A process on the bus.  All handlers run one after the other, inside `spin` or `run`: in the main thread.

    In lockstep those of a `prompt` service that is in `run` run in Zenoh's thread, which must not wait for an answer: none may `call`.
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
        """`session` and `inbox`: its own unless they are given; two services of one process share an inbox.

        `prompt`: every tick waits for it, and it never computes for long, so that Zenoh's own thread may put into its inbox, or
        in lockstep handle what it brings.
        """
        self.who, self.config, self.instance = who, config, f"i{os.getpid()}_{secrets.token_hex(3)}"
        signal.signal(signal.SIGTERM, _end)
        signal.signal(signal.SIGINT, _end)
        self.log = set_up_log(who)
        if config.mode == "lock":
            spare_threads()
        lease = config.patience if config.mode == "lock" else LEASE
        if session is None:
            wait_until_released()
        session = session or open_client(os.environ.get(LOCAL_ENDPOINT) or config.endpoint, namespace=config.namespace, lease=lease)
        with ExitStack() as failed:
            failed.enter_context(session)  # closed: an open callback would keep the interpreter from exiting
            self._begin(session, robot, inbox or Inbox(), prompt)
            failed.pop_all()

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
        self.words: Callable[[], Mapping[str, str]] = dict  # of `stat`: what is no number
        self.mark: Callable[[], None] = lambda: None  # zero the counters of `describe`: a measurement begins
        self.end: Callable[[], None] = _leave  # what a shutdown call leads to
        self._answering = Answering(self.bus)
        self._on_alive: list[Callable[[str, str, bool], None]] = []
        self._is_ready = False
        self._router, self._router_seen = "", time.monotonic()
        self._watch_liveliness()
        self.on_request(keys.service_rpc(self.who, "stat"), Empty, self._stat)
        self.on_request(keys.service_rpc(self.who, "mark"), Empty, self._mark)
        self.on_request(keys.service_rpc(self.who, "config"), Empty, self._config)
        self.on_request(keys.service_rpc(self.who, "shutdown"), Empty, self._shutdown)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with self.bus.session:  # closed even if a signal comes in between: an open callback would keep the interpreter from exiting
            _ignore_signals()
            if error is not None and not isinstance(error, SystemExit) and not self._says_all(error):
                self.log.error("ended by %s", error, exc_info=error)

    def _says_all(self, error: BaseException) -> bool:
        """Whether its text is enough for a person (entry.py prints it); a wrong value once all runs is a fault of ours."""
        return type(error) is MobeeError or (isinstance(error, MobeeError) and not self._is_ready)

    def on_alive(self, handler: Callable[[str, str, bool], None]) -> None:
        """Have (who, instance, up) told for every process that comes or goes."""
        self._on_alive.append(handler)

    def on_request(self, key: str, cls: type[_Q], handler: Callable[[_Q, str], Reply], part_of_key: bool = False) -> None:
        """Answer calls: handler(request, key) -> reply, or CallRefused.  `part_of_key`: its first chunk names the part."""

        def enqueue(query: zenoh.Query) -> None:
            self.inbox.offer(lambda: self._answering.answer(query, key, cls, handler, part_of_key), CROWDED_WITH_CALLS)

        self._kept.append(self.bus.session.declare_queryable(key, enqueue))

    def call(
        self, key: str, request: type[Request], reply: type[_R], *, timeout: float | None = None, tries: int = 1, **fields: object
    ) -> _R:
        """Ask another service, as rpc.call; raises rpc.CallFailed."""
        return rpc.call(self.bus.session, self.who, key, request, reply, timeout=timeout or self.patience, tries=tries, **fields)

    def ask(
        self,
        key: str,
        reply: type[_R],
        done: Callable[[_R | rpc.CallFailed], None],
        *,
        request: type[Request] = Empty,
        timeout: float = rpc.TIMEOUT,
        **fields: object,
    ) -> None:
        """Call that does not wait: `done` handles the answer or the failure in the main thread."""

        def enqueue(answer: _R | rpc.CallFailed) -> None:
            self.inbox.put(lambda: done(answer))

        rpc.ask(self.bus.session, self.who, key, reply, enqueue, request=request, timeout=timeout, **fields)

    def ready(self) -> None:
        """Tell the world: after every subscriber and queryable is declared."""
        gc.collect()
        gc.freeze()  # what lives as long as the process is not looked at again: a full collection would stall a tick
        _return_free_memory()
        self._is_ready = True
        self._kept.append(self.bus.session.liveliness().declare_token(keys.alive(self.who, self.instance)))
        self.log.info("ready as %s", self.instance)

    def spin(self, until: float, enough: Callable[[], bool] | None = None) -> None:
        """Handle what comes until that time of the monotonic clock, or until it was `enough`."""
        self.inbox.spin(until, enough)

    def run(self) -> None:
        """Handle what comes until SIGTERM, a shutdown call, or ten seconds without a router."""
        spin = self.inbox.serve if self._serves else self.inbox.spin
        while True:
            spin(time.monotonic() + 1.0)
            self.check_router()

    def check_router(self) -> None:
        """End the process when nobody routes any more: an orphan must not outlive its system."""
        if self.alive.get("router"):
            self._router_seen = time.monotonic()
        elif time.monotonic() - self._router_seen > ORPHANED:
            self.log.error("no router at %s for %g s: ending", self.config.endpoint, ORPHANED)
            raise SystemExit(ENVIRONMENT)

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
        if who == "router" and up:
            self._join(instance)
        for handler in self._on_alive:
            handler(who, instance, up)

    def _join(self, router: str) -> None:
        """A service belongs to the system it was started in: a later one at the same endpoint must not inherit it."""
        if self._router not in ("", router):
            self.log.error("another router came to %s: ending", self.config.endpoint)
            raise SystemExit(ENVIRONMENT)
        self._router = router

    def _stat(self, request: Empty, key: str) -> Stat:
        text, numbers = self.describe()
        return Stat(
            v=VERSION,
            who=self.who,
            instance=self.instance,
            pid=os.getpid(),
            uptime=time.monotonic() - self.started,
            ready=self._is_ready,
            text=text,
            numbers={name: float(value) for name, value in numbers.items()},
            words=dict(self.words()),
            rejected={**self.bus.rejected, **({"flood": self.inbox.dropped} if self.inbox.dropped else {})},
        )

    def _mark(self, request: Empty, key: str) -> Done:
        self.bus.rejected.clear()
        self.inbox.dropped = 0
        self.mark()
        return Done(v=VERSION)

    def _config(self, request: Empty, key: str) -> Config:
        return Config(v=VERSION, config=msgspec.json.encode(self.config).decode())

    def _shutdown(self, request: Empty, key: str) -> Done:
        self.log.info("asked by %s to end", request.who)
        self.inbox.at(time.monotonic() + 0.05, self.end)  # after the reply is out
        return Done(v=VERSION)


def _return_free_memory() -> None:
    """Return to the system what starting has used and freed, where the C library can: 23 MB where meshes were read."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc
    if trim is not None:
        trim(0)


def _leave() -> None:
    raise SystemExit(OK)


def _end(signum: int, frame: FrameType | None) -> None:
    _ignore_signals()  # a second one must not interrupt the end
    raise SystemExit(OK)


def _ignore_signals() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
