# SPDX-License-Identifier: Apache-2.0
"""Plays a recorded run in lockstep into its controller or model, and compares the new messages with the recorded ones, to the last bit.

In every tick the service receives the recorded input. The recording also gives the order of the calls. If the service had answered a call
before it answered the tick, the call is made right after the tick is sent. All other calls are made after the service has answered the
tick.

Messages are sent with their recorded bytes. Only the epochs of goals are different. An epoch is the number of one ownership of a part's
goal, and a controller counts epochs from its start. So the replay replaces the recorded epochs in calls, and in the recorded `Motion`
messages before it compares them.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec
from msgspec import Struct

from bus_schema.messages import Served
from bus_schema.rpc import Driven, PartMeta, Taken
from mobee.errors import MobeeError
from mobee_cli.replaying.differences import OF_THE_RUN, Difference, compare
from mobee_cli.replaying.stage import PATIENCE, Stage, Stopped
from mobee_cli.replaying.ticks import Item, TickOf, served_of

START = 30.0  # s until the service has answered tick 0
START_PERIOD = 0.1  # s between two repetitions of tick 0, as of robot_sim
TOKEN_PATIENCE = 3.0  # s within which the service must know a token that was declared
_NO_INPUT = ("/rpc/mark", "/rpc/shutdown")  # calls that change no result


@dataclass(frozen=True, slots=True)
class Role:
    """The messages that a service reads and sends in a tick, as names of message types.

    `with_tick`: messages of the model that the service needs before it can answer a tick; they are sent after the tick. `after`: messages
    of other services; they are sent when the service has answered the tick. `says`: messages that the service sends, and that are compared
    with the recorded ones. `answers`: function that returns whether a message is the service's answer to a tick.
    """

    with_tick: tuple[str, ...]
    after: tuple[str, ...]
    says: tuple[str, ...]
    answers: Callable[[Item], bool]


def _is_controllers_answer(item: Item) -> bool:
    return item.type == "StepDone" or (item.type == "Commands" and item.content()["answer"] is not None)


ROLES: Mapping[str, Role] = {
    "controller": Role(("Targets", "Forces"), ("EStop",), ("Motion", "Reach", "Commands", "StepDone"), _is_controllers_answer),
    "model": Role((), ("Reach", "WorldObject"), ("Targets", "Forces"), lambda item: item.type == "Forces"),
}


@dataclass(slots=True)
class Result:
    """The result of a replay into a service.

    `who`: the service. `ticks`: number of compared ticks. `messages`: number of compared messages. `calls`: number of
    recorded calls that were made again. `seconds`: real time of the replay [s]. `difference`: the first difference; None: all messages are
    equal. `says`: number of compared messages of each type, by the name of the type.
    """

    who: str
    ticks: int = 0
    messages: int = 0
    calls: int = 0
    seconds: float = 0.0
    difference: Difference | None = None
    says: dict[str, int] = field(default_factory=dict)


def replay_into(stage: Stage, run: Iterable[TickOf], last: int) -> Result:
    """Play the ticks of a run into a service, up to tick `last` or the first difference, and return the result.

    `stage`: a separate bus, on which only this service runs. Raises MobeeError if the run cannot be played, or the service does not answer.
    """
    begin = time.monotonic()
    replay = _Replay(stage, ROLES[stage.who])
    for tick in run:
        if tick.k > last or not replay.play(tick):
            break
    if not replay.result.ticks:
        raise MobeeError("nothing was compared: the recording needs two ticks after tick 0, and --ticks at least 2")
    replay.result.seconds = time.monotonic() - begin
    return replay.result


class _Replay:
    """A replay in progress."""

    def __init__(self, stage: Stage, role: Role) -> None:
        self._stage, self._role, self.result = stage, role, Result(stage.who)
        self._epochs: dict[int, int] = {}  # of goals: recorded -> of this replay
        self._drives: dict[str, deque[tuple[int, bytes]]] = {}  # key of a call to robot_sim -> ticks and recorded replies
        self._said: dict[int, list[Item]] = {}  # by tick
        self._answered = -1  # newest tick that the service has answered
        self._open: TickOf | None = None  # the last tick, which is compared when the next one is answered
        self._begun = False

    def play(self, tick: TickOf) -> bool:
        """Play a tick; returns False once a difference was found."""
        self._note_drives(tick)
        if not self._begun:
            if tick.of("Tick"):  # else the recording begins later, and a later tick has the mode of the run
                self._begin(tick)
            return True
        own = self._own(tick)
        at = next((index for index, item in enumerate(own) if self._role.answers(item)), len(own))
        self._publish(tick.of("Tick"))
        self._call(own[:at])
        for kind in ("", *self._role.with_tick):
            self._publish([item for item in tick.of(kind, "model") if kind])
        self._wait(tick.k)
        self._call(own[at:])
        self._after(tick)
        found, self._open = self._compare(self._open), tick
        return not found

    # The start

    def _begin(self, tick: TickOf) -> None:
        """Start the service, publish tick 0 until the service has answered it, and repeat the calls that it had received in tick 0.

        Raises MobeeError if the recording does not begin at tick 0, or was not made in lockstep.
        """
        if tick.of("Tick")[-1].content()["mode"] != "lock":
            raise MobeeError(
                'the recorded run was not in lockstep (shared.mode = "lock"), so its messages do not say when each was handled: record one '
                "with `mobee launch lockstep`, or with `--set shared.mode=lock`"
            )
        if tick.k != 0:
            raise MobeeError(
                "the recording does not begin at tick 0 of a run: its first file is needed, and a recorder that was there first"
            )
        self._begun = True
        self._tokens(tick)
        for key, kind in (("*/rpc/drive/take", Taken), ("*/rpc/drive/arm", Driven), ("*/meta", PartMeta)):
            self._stage.serve(key, self._answer_with(kind))
        self._stage.start()
        self._repeat_start(tick)
        own = self._own(tick)
        called = False
        for item in own:
            if item.type == "Served":
                self._call([item])
                called = True
            elif called and item.type == "Motion":  # the service had handled tick 0 once more
                self._repeat_start(tick)
                called = False
        self._after(tick, tokens=False)

    def _repeat_start(self, tick: TickOf) -> None:
        self._answered, give_up = -1, time.monotonic() + START
        inputs = [tick.of("Tick")[-1], *(item for kind in self._role.with_tick for item in tick.of(kind, "model")[-1:])]
        while self._answered < 0:
            self._publish(inputs)
            again = time.monotonic() + START_PERIOD
            while self._answered < 0 and (left := again - time.monotonic()) > 0.0:
                self._hear(left)
            self._stage.check()
            if time.monotonic() > give_up:
                raise Stopped(f"{self._stage.who} did not answer tick 0 within {START:g} s")

    # Messages to the service

    def _publish(self, items: Iterable[Item]) -> None:
        for item in items:
            self._stage.send(item.key, item.message.encoding, item.message.payload)

    def _after(self, tick: TickOf, tokens: bool = True) -> None:
        self._publish(item for item in tick.items if item.type in self._role.after and item.src != self._stage.who)
        if tokens:
            self._tokens(tick)

    def _tokens(self, tick: TickOf) -> None:
        for item in tick.items:
            if not item.type:
                token = item.content()
                if token["who"] not in (self._stage.who, "router"):
                    self._stage.token(token["who"], token["instance"], token["up"])

    def _call(self, items: Sequence[Item]) -> None:
        """Make the calls that the service had answered, except those that it had refused."""
        for item in items:
            if item.type != "Served":
                continue
            served = served_of(item.message)
            if served is None or served.reply_type == "Failure" or served.key.endswith(_NO_INPUT):
                continue
            request = msgspec.msgpack.decode(served.request)
            if "epoch" in request:
                request["epoch"] = self._epochs.get(request["epoch"], request["epoch"])
            answer = self._answer_of(served, msgspec.msgpack.encode(request))
            if served.reply_type == Taken.__name__:
                self._epochs[_epoch(served.reply)] = _epoch(answer)
            self.result.calls += 1

    def _answer_of(self, served: Served, request: bytes) -> bytes:
        """Make a call; repeat it for a while if the service does not know yet a token that was just declared."""
        give_up = time.monotonic() + TOKEN_PATIENCE
        while True:
            encoding, answer = self._stage.call(served.key, served.request_type, request)
            if f"/{served.reply_type}/" in encoding:
                return answer
            failure = msgspec.msgpack.decode(answer)
            if failure.get("code") != "token" or time.monotonic() > give_up:
                raise Stopped(f"{self._stage.who} refused {served.key} of tick {served.k}, which it had accepted: {failure.get('text')}")
            time.sleep(0.02)

    # Calls of the service to robot_sim

    def _note_drives(self, tick: TickOf) -> None:
        """Keep the replies of robot_sim to the service's calls, so that it gets them again."""
        for item in tick.of("Served", "robot_sim"):
            served = served_of(item.message)
            if served and served.reply_type != "Failure" and msgspec.msgpack.decode(served.request).get("who") == self._stage.who:
                replies = self._drives.setdefault(served.key, deque())
                if tick.k == 0:
                    replies.clear()  # the last try of the start is the one whose epoch holds
                replies.append((tick.k, served.reply))

    def _answer_with(self, kind: type[Struct]) -> Callable[[str, dict[str, Any]], tuple[type[Struct], bytes] | None]:
        def answer(key: str, request: dict[str, Any]) -> tuple[type[Struct], bytes] | None:
            replies = self._drives.get(key)
            if not replies:
                return None
            return kind, (replies.popleft() if len(replies) > 1 else replies[0])[1]

        return answer

    # Messages of the service

    def _own(self, tick: TickOf) -> list[Item]:
        return [item for item in tick.items if item.src == self._stage.who]

    def _wait(self, k: int) -> None:
        """Wait until the service has answered tick k."""
        give_up = time.monotonic() + PATIENCE
        while self._answered < k:
            self._hear(give_up - time.monotonic())
            if time.monotonic() > give_up:
                self._stage.check()
                raise Stopped(f"{self._stage.who} did not answer tick {k} within {PATIENCE:g} s")

    def _hear(self, seconds: float) -> None:
        item = self._stage.next(max(seconds, 0.0))
        if item is None or item.type not in self._role.says:
            return
        k = item.content()["k"]
        self._said.setdefault(k, []).append(item)
        if self._role.answers(item):
            self._answered = max(self._answered, k)

    def _compare(self, tick: TickOf | None) -> bool:
        """Compare the recorded messages of the service at a tick with those that it sent in the replay; return whether they differ.

        The tick must be complete; None: nothing is compared, and the result is False.
        """
        if tick is None:
            return False
        then = [item for item in self._own(tick) if item.type in self._role.says]
        now = self._said.pop(tick.k, [])
        self.result.difference = compare(tick.k, [self._translated(item) for item in then], now, OF_THE_RUN)
        self.result.ticks += 1
        self.result.messages += len(then)
        for item in then:
            self.result.says[item.type] = self.result.says.get(item.type, 0) + 1
        return self.result.difference is not None

    def _translated(self, item: Item) -> Item:
        """Return a recorded motion with the epoch of this replay."""
        if item.type != "Motion":
            return item
        content = item.content()
        epoch = self._epochs.get(content["epoch"], content["epoch"])
        if epoch == content["epoch"]:
            return item
        payload = msgspec.msgpack.encode({**content, "epoch": epoch})
        return Item(msgspec.structs.replace(item.message, payload=payload), item.src)


def _epoch(taken: bytes) -> int:
    return int(msgspec.msgpack.decode(taken)["epoch"])
