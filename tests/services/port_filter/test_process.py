# SPDX-License-Identifier: Apache-2.0
"""The port filter as a process, between a client's own program and robot_sim as a process, in lockstep: no load changes a motion."""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pytest
from zenoh.handlers import FifoChannel, RingChannel

from bus_schema import keys
from bus_schema.messages import Clock, Command, EStop, Event, State, StepDone
from bus_schema.rpc import Done, Driven, Empty, PartMeta, Request, Take, Taken, WithEpoch
from mobee.arrays import Array
from mobee.robot.load import load_robot
from services.common import rpc
from services.common.bus import Bus
from services.common.rpc import CallFailed
from services.common.session import open_client
from tests.services.harness import Rig, rig, wait_for

ROBOT = load_robot("icub")
TORSO = ROBOT.part("torso")
YAW, PITCH = TORSO.motors.index("torso_yaw"), TORSO.motors.index("torso_pitch")
FAST = float(np.deg2rad(25.0))  # rad/s
NEAR = np.deg2rad(1.5)  # rad: backlash, noise of the encoders and of the recorded poses
LOCKSTEP = ("--mode", "lock", "--patience", "20")
ROBOT_ITSELF, FILTERED = "icub", "icub_filtered"


class Client:
    """A program that drives the torso; it knows a robot by its namespace alone. Every tick waits until it asks for the next one."""

    def __init__(self, endpoint: str, namespace: str, name: str = "client") -> None:
        self.session = open_client(endpoint, namespace=namespace)
        self.bus, self.name = Bus(self.session, name, logging.getLogger(name)), name
        self.bus.part_sizes, self.bus.control = {"torso": len(TORSO)}, "STEP"
        self.token = self.session.liveliness().declare_token(keys.alive(name, "c1"))
        self.clock = self.session.declare_subscriber(Clock.stream.key(), RingChannel(1))
        self.states = self.bus.latest(State, "torso")
        self.commands = self.bus.publisher(Command, "torso")
        self.answers, self.answered = self.bus.publisher(StepDone, name), -1
        self.events: list[Event] = []
        self.state: State | None = None
        self.epoch = self.sent = 0
        self.told_of = self.session.declare_subscriber(Event.stream.key("robot_sim"), FifoChannel(1000))
        wait_for(self.tick, "the clock")
        wait_for(lambda: self.tick() and self.state, "the state")

    def close(self) -> None:
        self.session.close()

    def tick(self) -> bool:
        """Whether a tick has come since the last call; what was sent before the call answers the one before."""
        if self.answered < self.bus.k:
            self.answered = self.bus.k
            self.done()
        sample = self.clock.try_recv()
        clock = None if sample is None else self.bus.receive(Clock, sample, any_run=True)
        if clock is None:
            return False
        self.bus.run, self.bus.k, self.bus.t = clock.run, clock.k, clock.t
        self.state = self.states.take() or self.state
        while (sample := self.told_of.try_recv()) is not None:
            self.events += filter(None, [self.bus.receive(Event, sample, any_run=True)])
        return True

    def done(self, last: bool = False) -> None:
        """Answer the newest tick; after the `last` answer no tick waits for this program."""
        self.answers.put(re_k=self.bus.k, ok=True, busy=[], last=last, including=[])

    @property
    def q(self) -> Array:
        assert self.state is not None
        return np.array(self.state.q)

    def is_near(self, q: Array) -> bool:
        return bool(np.abs(self.q - q).max() < NEAR)

    @property
    def gate(self) -> str:
        assert self.state is not None
        return str(self.state.gate)

    def call(self, key: str, request: type[Request], reply: type, **fields: object) -> object:
        return rpc.call(self.session, self.name, key, request, reply, timeout=10.0, **fields)

    def arm(self) -> None:
        self.until(self._took, "the drive")
        assert self.call(keys.drive("torso", "arm"), WithEpoch, Driven, epoch=self.epoch).gate == "armed"
        self.until(lambda: self.gate == "armed", "the armed state")

    def _took(self) -> bool:
        """Whether the drive was given; not while the reflex takes the robot back."""
        try:
            self.epoch = self.call(keys.drive("torso", "take"), Take, Taken, instance="c1").epoch
        except CallFailed as failed:
            if "wait, then arm again" not in str(failed):
                raise
            return False
        return True

    def accept(self) -> None:
        """Answer for the pose as it is."""
        self.call(keys.waypoint("torso"), Empty, Done)

    def until(self, condition: Callable[[], bool], what: str, timeout: float = 10.0) -> None:
        wait_for(lambda: self.tick() and condition(), what, timeout)

    def go(self, motor: int, degrees: float) -> None:
        """A position move, then a short rest; ends early when the gate does not obey any more."""
        self.commands.put(epoch=self.epoch, re_k=self.bus.k, mode="hold", ref=self.q.tolist(), ttl=1000)
        reference, rest = self.q, 0.0
        begin = self.bus.t
        while self.gate == "armed" and rest < 0.8:
            if self.tick():
                step = FAST * (self.bus.t - begin) * 1e-9
                begin = self.bus.t
                reference[motor] += np.clip(np.deg2rad(degrees) - reference[motor], -step, step)
                rest = rest + step / FAST if reference[motor] == np.deg2rad(degrees) else 0.0
                self.send("position", reference.tolist())

    def drive(self, motor: int, speed: float, over: Callable[[], bool]) -> None:
        """A velocity, rad/s, until it is over or the gate does not obey any more."""
        reference = [0.0] * len(TORSO)
        reference[motor] = speed
        while self.gate == "armed" and not over():
            if self.tick():
                self.send("velocity", reference)

    def send(self, mode: str, reference: list[float]) -> None:
        self.commands.put(epoch=self.epoch, re_k=self.bus.k, mode=mode, ref=reference, ttl=1000)
        self.sent += 1

    def has_event(self, code: str) -> Callable[[], bool]:
        return lambda: any(event.code == code for event in self.events)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("filter"), ROBOT) as made:
        made.start("services.robot_sim", "robot_sim", "--backend", "kinematic", "--seed", "7", "--participants", "port_filter", *LOCKSTEP)
        program = made.start("services.port_filter", "port_filter", *LOCKSTEP)
        yield made
        assert program.stop(signal.SIGTERM) == 0


@pytest.fixture
def client(robot: Rig) -> Iterator[Callable[[str], Client]]:
    made: list[Client] = []

    def make(namespace: str) -> Client:
        made.append(Client(robot.endpoint, namespace))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.parametrize(("namespace", "degrees"), [(ROBOT_ITSELF, 6.0), (FILTERED, 0.0)])
def test_one_program_drives_the_robot_and_its_filtered_twin(client: Callable[[str], Client], namespace: str, degrees: float) -> None:
    mine = client(namespace)
    meta = mine.call(keys.meta("torso"), Empty, PartMeta)
    assert tuple(meta.motors) == TORSO.motors
    assert any(True for _ in mine.session.liveliness().get(keys.alive("router", "rig")))
    mine.arm()
    mine.go(YAW, degrees)
    assert mine.gate == "armed"
    assert abs(mine.q[YAW] - np.deg2rad(degrees)) < NEAR
    assert mine.state is not None
    assert mine.state.epoch == mine.epoch
    assert 0 <= mine.sent - mine.state.cmd_seq <= 20  # the client's own numbers, of commands that are a few ticks old
    assert mine.state.cmd_age >= 0
    with pytest.raises(CallFailed, match="epoch"):
        mine.call(keys.drive("torso", "arm"), WithEpoch, Driven, epoch=mine.epoch - 1)
    mine.bus.publisher(EStop).put(set=True, source="test", reason="because")
    mine.until(lambda: mine.gate == "estop", "the stop")
    mine.call(keys.ESTOP_RESET, Empty, Done)
    mine.until(lambda: mine.gate == "hold", "its end")
    assert mine.call(keys.drive("torso", "release"), WithEpoch, Driven, epoch=mine.epoch).gate == "idle"


def undo(mine: Client, motion: Callable[[], Array], during: Callable[[], None] = lambda: None) -> None:
    """Make a motion into the table, which the reflex undoes, back to the pose that `motion` returns."""
    mine.accept()
    mine.arm()
    begun = motion()
    mine.until(lambda: mine.gate == "hold", "the end of the motion")
    during()
    mine.until(mine.has_event("motion_failed"), "the end of the reflex")
    mine.until(partial(mine.is_near, begun), "the pose in which the motion began")
    assert mine.has_event("reflex")()


def test_a_motion_into_the_table_is_undone_and_reported_to_its_client(client: Callable[[str], Client]) -> None:
    mine = client(FILTERED)

    def motion() -> Array:
        mine.go(PITCH, 0.0)
        mine.go(YAW, 4.0)
        mine.go(PITCH, 40.0)
        return np.deg2rad([4.0, 0.0, 0.0])  # where this move began, not the one before

    def during() -> None:
        assert mine.q[PITCH] < np.deg2rad(15.0)
        with pytest.raises(CallFailed, match="reflex") as refused:
            mine.call(keys.drive("torso", "take"), Take, Taken, instance="c1")
        assert refused.value.code == "reflex"

    undo(mine, motion, during)
    mine.arm()
    mine.go(YAW, 0.0)
    assert mine.gate == "armed"


def test_in_another_modality_the_reflex_goes_back_to_a_waypoint_set_by_a_call(client: Callable[[str], Client]) -> None:
    mine = client(FILTERED)

    def motion() -> Array:
        mine.go(PITCH, 0.0)
        mine.drive(YAW, FAST, lambda: bool(mine.q[YAW] > np.deg2rad(5.0)))
        mine.drive(YAW, 0.0, lambda: mine.bus.k % 30 == 0)
        here = mine.q
        mine.accept()
        mine.drive(PITCH, FAST, lambda: False)
        return here

    undo(mine, motion)


def test_a_robot_that_starts_in_contact_moves_when_a_client_accepts_the_pose(client: Callable[[str], Client]) -> None:
    direct = client(ROBOT_ITSELF)
    direct.arm()
    direct.go(PITCH, 10.0)
    direct.call(keys.drive("torso", "release"), WithEpoch, Driven, epoch=direct.epoch)
    direct.done(last=True)
    mine = client(FILTERED)
    with pytest.raises(CallFailed, match="table .* no motion back.* rpc/waypoint"):
        mine.arm()
    mine.accept()
    mine.arm()
    mine.go(PITCH, 0.0)
    assert mine.gate == "armed"
    assert abs(mine.q[PITCH]) < NEAR


def test_a_part_that_is_released_while_the_reflex_is_stuck_is_free_for_others(client: Callable[[str], Client]) -> None:
    """The filter has not moved this part back, and needs its drive no longer."""
    mine = client(FILTERED)
    epoch = mine.call(keys.drive("head", "take"), Take, Taken, instance="c1").epoch
    mine.done(last=True)
    direct = client(ROBOT_ITSELF)
    direct.arm()
    direct.go(PITCH, 10.0)
    with pytest.raises(CallFailed, match="table .* no motion back"):
        mine.call(keys.drive("head", "take"), Take, Taken, instance="c1")
    assert mine.call(keys.drive("head", "release"), WithEpoch, Driven, epoch=epoch).gate == "idle"
    assert direct.call(keys.drive("head", "take"), Take, Taken, instance="c1").epoch > epoch
    direct.go(PITCH, 0.0)
    direct.call(keys.drive("torso", "release"), WithEpoch, Driven, epoch=direct.epoch)
    direct.done(last=True)
    mine.accept()


def test_the_robot_is_released_when_the_client_ends(robot: Rig, client: Callable[[str], Client]) -> None:
    mine = client(FILTERED)
    states = robot.record(State, "torso")
    mine.arm()
    wait_for(lambda: states and states[-1].gate == "armed", "the robot")
    mine.close()
    wait_for(lambda: states[-1].gate == "idle", "the release")
