# SPDX-License-Identifier: Apache-2.0
"""What a fuzzer feeds besides robots: scenarios, maps, records of learning, recordings, and the messages of the bus.

Each `feed_*` returns whether the reader accepts the content, and raises everything except the refusals that it documents.
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bus_schema import decode, encode, encoding_of
from bus_schema.codec import Refused
from bus_schema.page import streams
from bus_schema.rpc import CALLS
from experiments.kit.live.malformed import Drawer
from mobee import CuriousAgent, Lattice, OfflinePlant
from mobee.errors import MobeeError
from mobee.learning.record import load_learned
from mobee.model.model import Model
from mobee.roadmap.roadmap import Roadmap, load_roadmap
from mobee.robot.load import load_robot
from mobee.store import TransitionStore
from services.common.config import ConfigError
from services.launcher.scenario import read_scenario, shipped
from services.recorder.files import Channel, Files
from services.recorder.reader import Recording

LONGEST = 4000  # characters of a message that a person reads
PARTS = {"head": 6, "torso": 3, "left_arm": 16, "right_arm": 16}
MESSAGES = (*streams(), *(call.request for call in CALLS), *(call.reply for call in CALLS))
DRAWN = 200  # messages among the seeds
_ROBOT = cache(load_robot)


def feed_scenario(content: bytes, folder: Path) -> bool:
    """Read `content` as a scenario."""
    path = folder / "given.toml"
    path.write_bytes(content)
    return _accepts(lambda: read_scenario(str(path)), ConfigError, path)


def feed_roadmap(content: bytes, folder: Path) -> bool:
    """Read `content` as a roadmap."""
    path = folder / "given.npz"
    path.write_bytes(content)
    return _accepts(lambda: load_roadmap(path, robot=_ROBOT("katana")), MobeeError, path)


def feed_store(content: bytes, folder: Path) -> bool:
    """Read `content` as the record of an agent, and rebuild what it has learned."""
    path = folder / "given.sqlite"
    for old in folder.glob("given.sqlite*"):
        old.unlink()
    path.write_bytes(content)
    return _accepts(lambda: load_learned(path, "arm", _ROBOT("katana")), MobeeError, path)


def feed_recording(content: bytes, folder: Path) -> bool:
    """Read `content` as a recording: a damaged one up to its first damage."""
    path = folder / "given.mcap"
    path.write_bytes(content)
    return _accepts(lambda: (Recording(path).settings(), list(Recording(path))), MobeeError, path)


def feed_message(content: bytes, folder: Path) -> bool:
    """Decode `content` after its first byte, which chooses the type; what is accepted is the same after encoding and decoding."""
    cls = MESSAGES[content[0] % len(MESSAGES)] if content else MESSAGES[0]
    try:
        message = decode(cls, content[1:], encoding_of(cls), part=PARTS["left_arm"], robot=sum(PARTS.values()))
    except Refused:
        return False
    if decode(cls, encode(message), encoding_of(cls)) != message:
        raise AssertionError(f"{message} changes when it is sent on")
    return True


def _accepts(read: Callable[[], object], refusal: type[Exception], path: Path) -> bool:
    try:
        read()
    except refusal as error:
        text = str(error)
        if "\n" in text or len(text) > LONGEST:
            raise AssertionError(f"{path}: a message of several lines, or endless: {text[:300]}") from None
        return False
    return True


def scenario_seeds() -> list[bytes]:
    """Return the shipped scenarios."""
    return [path.read_bytes() for path in shipped().values()]


def roadmap_seeds() -> list[bytes]:
    """Return a small map."""
    robot = load_robot("katana")
    q = robot.home + np.random.default_rng(0).uniform(-0.1, 0.1, (4, len(robot.motors)))
    edges = np.array([[0, 1], [1, 2], [2, 3]])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.npz"
        Roadmap(Model(robot), q, q[:, :2], edges, np.ones(2), {"names": ["x", "y"]}).save(path)
        return [path.read_bytes()]


def store_seeds() -> list[bytes]:
    """Return the record of an agent that has made some transitions."""
    plant = OfflinePlant(Model(load_robot("katana")))
    space = Lattice(plant.robot, plant.robot.motors[:2], neighbours=4)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.sqlite"
        with TransitionStore(path, space.part) as store:
            CuriousAgent(space, plant, store=store).run(4)
        return [path.read_bytes()]


def recording_seeds() -> list[bytes]:
    """Return a recording of drawn messages."""
    with tempfile.TemporaryDirectory() as folder:
        files = Files(Path(folder), 10_000_000, {"model.toml": b"rate = 100"})
        for n, (cls, payload) in enumerate(_drawn()[:50]):
            files.write(Channel("icub/tick", "msgpack", encoding_of(cls)), payload, 10**18 + n, 10**18, n)
        files.close()
        return [(Path(folder) / "messages-0000.mcap").read_bytes()]


def message_seeds() -> list[bytes]:
    """Return drawn messages, each after a byte that chooses its type."""
    return [bytes([MESSAGES.index(cls)]) + payload for cls, payload in _drawn()]


def _drawn() -> list[tuple[Any, bytes]]:
    drawer, random_ = Drawer(1, PARTS), random.Random(1)
    known, found = {encoding_of(cls): cls for cls in MESSAGES}, []
    for _ in range(DRAWN):
        drawn = drawer.request() if random_.random() < 0.3 else drawer.message()
        with suppress(KeyError):  # a drawn one of another version
            found.append((known[drawn.encoding], drawn.payload))
    return found
