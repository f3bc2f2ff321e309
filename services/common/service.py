"""The life of a service: session, inbox, requests, liveliness, and an end that is quick from every state."""

from __future__ import annotations

import gc
import os
import secrets
import signal
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from types import FrameType, TracebackType
from typing import Any, Self, TypeVar

import msgspec
import zenoh
import zenoh.ext
from zenoh.handlers import Callback

from bus_schema import VERSION, Refused, decode, encode, encoding_of, keys
from bus_schema.chain import Tick
from bus_schema.messages import Clock, Message, Turn
from bus_schema.rpc import Config, Done, Empty, Failure, Reply, Request, Stat
from mobee.errors import MobeeError
from mobee.robot.robot import Robot
from services.common import log, rpc
from services.common.bus import NO_RUN, Bus
from services.common.config import ServiceConfig
from services.common.delivery import LATEST, STEP
from services.common.inbox import CROWDED, CROWDED_WITH_CALLS, Inbox, Newest
from services.common.session import LEASE, open_client, spare_threads

_M = TypeVar("_M", bound=Message)
_Q = TypeVar("_Q", bound=Request)
_R = TypeVar("_R", bound=Reply)
_T = TypeVar("_T", Clock, Tick, Turn)

ORPHANED = 10.0  # s without a router after which a service ends
REMEMBERED = 256  # replies kept, so that a repeated call is harmless


class CallRefused(Exception):
    """Raised by a request's handler: the caller gets code and text."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class Service:
    """A process on the bus.  All handlers run in the main thread, inside `spin` or `run`."""

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

        `prompt`: every tick waits for it, and it never computes for long, so that Zenoh's own thread may put into its inbox.
        """
        self.who, self.config, self.instance = who, config, f"i{os.getpid()}_{secrets.token_hex(3)}"
        signal.signal(signal.SIGTERM, _end)
        signal.signal(signal.SIGINT, _end)
        self.log = log.set_up(who)
        if config.mode == "lock":
            spare_threads()
        lease = config.patience if config.mode == "lock" else LEASE
        session = session or open_client(config.endpoint, namespace=config.namespace, lease=lease)
        self.inbox = inbox or Inbox()
        self._direct = prompt or config.mode == "lock"
        try:
            self._begin(session, robot)
        except BaseException:
            session.close()  # type: ignore[no-untyped-call]  # an open callback would keep the interpreter from exiting
            raise

    def _begin(self, session: zenoh.Session, robot: Robot | None) -> None:
        self.bus = Bus(session, self.who, self.log)
        self.locked = self.config.mode == "lock"
        self.keeps_step = False  # a Participant of lockstep says otherwise
        self.dawdle: Callable[[], None] = lambda: None  # before every tick: for tests of lockstep
        self.bus.control = STEP if self.locked else LATEST
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
        self._kept: list[Any] = []  # tokens die with their handles
        self._replies: OrderedDict[tuple[str, str], tuple[type[Reply], bytes]] = OrderedDict()
        self._on_alive: list[Callable[[str, str, bool], None]] = []
        self._on_run: list[Callable[[], None]] = []
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
        try:
            _ignore_signals()
            if error is not None and not isinstance(error, SystemExit) and not self._says_all(error):
                self.log.error("ended by %s", error, exc_info=error)
        finally:  # even if a signal came in between
            self.bus.session.close()  # type: ignore[no-untyped-call]  # an open callback would keep the interpreter from exiting

    def _says_all(self, error: BaseException) -> bool:
        """Whether its text is enough for a person (entry.py prints it); a wrong value once all runs is a fault of ours."""
        return type(error) is MobeeError or (isinstance(error, MobeeError) and not self._is_ready)

    def on_newest(self, key: str, cls: type[_M], handler: Callable[[_M], None], part: str | None = None) -> None:
        """Have the newest message of a stream handled; older ones waiting are overwritten."""
        self._subscribe(key, self._newest(lambda sample: self._deliver(cls, sample, handler, part)))

    def on_each(
        self,
        key: str,
        cls: type[_M],
        handler: Callable[[_M], None],
        *,
        part: str | None = None,
        history: bool = False,
        any_run: bool = False,
        crowd: int = CROWDED,
        later: bool = False,
    ) -> None:
        """Have every message of a stream handled, with `history` also those from before this service came.

        `crowd`: how many may be waiting for the main thread before this stream's messages are dropped.  `later`: they wait for
        a message of another stream, before which they are handled.
        """

        def enqueue(sample: zenoh.Sample) -> None:
            offer = self.inbox.offer_later if later else self.inbox.offer
            offer(lambda: self._deliver(cls, sample, handler, part, any_run), crowd)

        if history:
            settings = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            self._kept.append(zenoh.ext.declare_advanced_subscriber(self.bus.session, key, enqueue, history=settings))
        else:
            self._subscribe(key, enqueue)

    def _newest(self, handle: Callable[[zenoh.Sample], None]) -> Callable[[zenoh.Sample], None]:
        """The newest sample only; one after the other for who keeps step, since a slot would mix up the order of two streams."""
        slot = Newest(self.inbox, handle)

        def offer(sample: zenoh.Sample) -> None:
            if self.keeps_step:
                self.inbox.put(lambda: handle(sample))
            else:
                slot.offer(sample)

        return offer

    def _subscribe(self, key: str, offer: Callable[[zenoh.Sample], None]) -> None:
        """Each subscriber has a thread of its own, which costs time and in lockstep would mix up what one service put on two keys."""
        self._kept.append(self.bus.session.declare_subscriber(key, Callback(offer, indirect=False) if self._direct else offer))

    def on_clock(self, handler: Callable[[Clock], None]) -> None:
        """Have every tick handled that is not overtaken; a new run is announced to `on_run` first."""
        self._on_time(keys.CLOCK, Clock, handler)

    def on_tick(self, handler: Callable[[Tick], None]) -> None:
        """As on_clock, for who computes on the body: every tick comes with the newest state of every part."""

        def whole(tick: Tick) -> None:
            if tick.parts.keys() == self.bus.part_sizes.keys():
                handler(tick)
            else:
                self.bus.reject("part", f"Tick of {', '.join(tick.parts)}: this robot has {', '.join(self.bus.part_sizes)}")

        self._on_time(keys.TICK, Tick, whole)

    def on_turn(self, handler: Callable[[Turn], None]) -> None:
        """Lockstep, instead of `on_clock`: have only those ticks handled that wait for this service."""
        self._on_time(keys.turn(self.who), Turn, handler)

    def _on_time(self, key: str, cls: type[_T], handler: Callable[[_T], None]) -> None:
        def tick(sample: zenoh.Sample) -> None:
            time = self.bus.receive(cls, sample, any_run=True)
            if time is None:
                return
            self.dawdle()
            self.bus.k, self.bus.t, self.bus.dt = time.k, time.t, time.dt
            if time.run != self.bus.run:
                known, self.bus.run = self.bus.run, time.run
                if known != NO_RUN:
                    self.bus.event("warning", "new_run", f"robot_sim started run {time.run} after {known}")
                for announce in self._on_run:
                    announce()
            handler(time)

        self._subscribe(key, self._newest(tick))

    def on_run(self, handler: Callable[[], None]) -> None:
        """Have it called at the first tick of every run."""
        self._on_run.append(handler)

    def on_alive(self, handler: Callable[[str, str, bool], None]) -> None:
        """Have (who, instance, up) told for every process that comes or goes."""
        self._on_alive.append(handler)

    def on_request(self, key: str, cls: type[_Q], handler: Callable[[_Q, str], Reply], part_of_key: bool = False) -> None:
        """Answer calls: handler(request, key) -> reply, or CallRefused.  `part_of_key`: its first chunk names the part."""

        def enqueue(query: zenoh.Query) -> None:
            self.inbox.offer(lambda: self._answer(query, key, cls, handler, part_of_key), CROWDED_WITH_CALLS)

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
        self._is_ready = True
        self._kept.append(self.bus.session.liveliness().declare_token(keys.alive(self.who, self.instance)))
        self.log.info("ready as %s", self.instance)

    def spin(self, until: float, enough: Callable[[], bool] | None = None) -> None:
        """Handle what comes until that time of the monotonic clock, or until it was `enough`."""
        self.inbox.spin(until, enough)

    def run(self) -> None:
        """Handle what comes until SIGTERM, a shutdown call, or ten seconds without a router."""
        while True:
            self.inbox.spin(time.monotonic() + 1.0)
            self.check_router()

    def check_router(self) -> None:
        """End the process when nobody routes any more: an orphan must not outlive its system."""
        if self.alive.get("router"):
            self._router_seen = time.monotonic()
        elif time.monotonic() - self._router_seen > ORPHANED:
            self.log.error("no router at %s for %g s: ending", self.config.endpoint, ORPHANED)
            raise SystemExit(3)

    def _deliver(self, cls: type[_M], sample: zenoh.Sample, handler: Callable[[_M], None], part: str | None, any_run: bool = False) -> None:
        message = self.bus.receive(cls, sample, part, any_run=any_run)
        if message is not None:
            handler(message)

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
            raise SystemExit(3)
        self._router = router

    def _answer(self, query: zenoh.Query, declared: str, cls: type[_Q], handler: Callable[[_Q, str], Reply], part_of_key: bool) -> None:
        key = str(query.key_expr) if "*" in declared else declared  # answers to one wildcard call must differ by key
        with query:
            try:
                reply_type, payload = self._reply(query, cls, handler, key, part_of_key)
            except (Refused, CallRefused) as refused:
                code = refused.reason if isinstance(refused, Refused) else refused.code
                self.bus.reject(code, f"{key}: {refused}")
                query.reply_err(encode(Failure(v=VERSION, code=code, text=str(refused)[:2000])), encoding=encoding_of(Failure))
                return
            query.reply(key, payload, encoding=encoding_of(reply_type))

    def _reply(
        self, query: zenoh.Query, cls: type[_Q], handler: Callable[[_Q, str], Reply], key: str, part_of_key: bool
    ) -> tuple[type[Reply], bytes]:
        size = None
        if part_of_key:
            part = key.split("/")[0]
            if part not in self.bus.part_sizes:
                raise CallRefused("part", f"no part {part!r}; there are {', '.join(self.bus.part_sizes)}")
            size = self.bus.part_sizes[part]
        if query.payload is None or query.encoding is None:
            raise Refused("decode", f"{cls.__name__}: an empty request")
        request = decode(cls, query.payload.to_bytes(), str(query.encoding), part=size, robot=self.bus.robot_size)
        call = (key, request.id)
        if call not in self._replies:
            reply = handler(request, key)
            self._replies[call] = (type(reply), encode(reply))
            if len(self._replies) > REMEMBERED:
                self._replies.popitem(last=False)
        return self._replies[call]

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


def _leave() -> None:
    raise SystemExit(0)


def _end(signum: int, frame: FrameType | None) -> None:
    _ignore_signals()  # a second one must not interrupt the end
    raise SystemExit(0)


def _ignore_signals() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
