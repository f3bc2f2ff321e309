"""robot_sim as a process; the test plays router, controller, model and everybody else."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.chain import Commands, Order, Tick
from bus_schema.messages import Clock, Command, EStop, Event, Message, State, Truth
from bus_schema.rpc import Done, Driven, Empty, PartMeta, Place, Request, Take, Taken, WithEpoch
from mobee.kinematics.gravity import gravity_torque
from mobee.robot.load import load_robot
from services.common.delivery import LATEST
from services.common.rpc import CallFailed
from tests.services.harness import Rig, free_endpoint, rig, wait_for

ROBOT = load_robot("icub")
ELBOW = 3
ARM = len(ROBOT.part("left_arm"))
DT = 0.01


class Bench:
    """The process under test and all it says; plus a controller's hands."""

    def __init__(self, bus: Rig, *arguments: str) -> None:
        self.rig = bus
        self.clocks: list[Clock] = bus.record(keys.CLOCK, Clock)
        self.states: dict[str, list[State]] = {part: bus.record(keys.state(part), State, part) for part in ROBOT.parts}
        self.events: list[Event] = bus.record(keys.event("robot_sim"), Event)
        self.truths: list[Truth] = bus.record(keys.SIM_TRUTH, Truth)
        self.commands = {part: bus.bus.publisher(keys.command(part), Command, LATEST) for part in ROBOT.parts}
        bus.token("controller", "c1")
        self.program = bus.start("services.robot_sim", "robot_sim", "--seed", "7", *arguments)
        self.follow()

    def follow(self) -> None:
        """Take up the run that goes on now."""
        seen = len(self.clocks)
        wait_for(lambda: len(self.clocks) > seen and all(self.states.values()), "the streams")
        self.rig.bus.run = self.clocks[-1].run

    def newest(self, part: str) -> State:
        return self.states[part][-1]

    def next_state(self, part: str) -> State:
        """One that was sampled after now."""
        seen = len(self.states[part])
        wait_for(lambda: len(self.states[part]) > seen + 1, f"a state of {part}")
        return self.newest(part)

    def drive(self, part: str, verb: str, epoch: int) -> str:
        return str(self.rig.call(keys.drive(part, verb), WithEpoch, Driven, who="controller", epoch=epoch).gate)

    def free(self, part: str) -> None:
        """Have the part belong to nobody."""
        self.drive(part, "release", self.take(part))

    def take(self, part: str, instance: str = "c1") -> int:
        return int(self.rig.call(keys.drive(part, "take"), Take, Taken, who="controller", instance=instance).epoch)

    def arm(self, part: str) -> int:
        epoch = self.take(part)
        assert self.drive(part, "arm", epoch) == "armed"
        return epoch

    def send(self, part: str, epoch: int, ref: list[float], mode: str = "velocity", ttl: int = 1000, **fields: Any) -> None:
        fields.setdefault("re_k", self.clocks[-1].k)
        self.commands[part].put(epoch=epoch, mode=mode, ref=ref, ttl=ttl, **fields)

    def keep(self, part: str, epoch: int, seconds: float, ref: Callable[[], list[float]], **fields: Any) -> None:
        """Answer every tick for a time of robot_sim's clock."""
        end = self.clocks[-1].t + seconds * 1e9
        while self.clocks[-1].t < end:
            seen = len(self.clocks)
            self.send(part, epoch, ref(), **fields)
            wait_for(lambda seen=seen: len(self.clocks) > seen, "a tick")

    def rejected(self, reason: str) -> int:
        return self.rig.stat("robot_sim").rejected.get(reason, 0)

    def numbers(self) -> dict[str, float]:
        return self.rig.stat("robot_sim").numbers


def elbow(value: float) -> list[float]:
    ref = [0.0] * ARM
    ref[ELBOW] = value
    return ref


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with rig(tmp_path_factory.mktemp("robot_sim"), ROBOT) as bus:
        yield Bench(bus, "--backend", "kinematic")


def test_a_tick_holds_what_each_part_said_last(bench: Bench) -> None:
    ticks = bench.rig.record(keys.TICK, Tick)
    wait_for(lambda: len(ticks) > 10, "ticks")
    tick = ticks[5]
    for part, states in bench.states.items():
        state = wait_for(lambda s=states, part=part: next((x for x in s if x.t == tick.parts[part].t), None), f"the state of {part}")
        assert (state.k, state.gate, state.epoch) == (tick.parts[part].k, tick.parts[part].gate, tick.parts[part].epoch)
        assert state.k == tick.k - 1
        assert state.q == tick.q[ROBOT.part(part).slice]


def test_the_clock_is_told_a_hundred_times_a_second_at_most_and_every_tick_is(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as bus:
        ticks, clocks = bus.record(keys.TICK, Tick), bus.record(keys.CLOCK, Clock)
        bus.start("services.robot_sim", "robot_sim", "--backend", "kinematic", "--rate", "400")
        wait_for(lambda: len(ticks) > 100 and len(clocks) > 20, "ticks")
        assert {clock.k % 4 for clock in clocks} == {0}
        assert min(after.k - before.k for before, after in pairwise(ticks)) == 1


def test_orders_to_all_parts_come_in_one_message_and_refusals_concern_a_part(bench: Bench) -> None:
    epochs = {part: bench.arm(part) for part in ("torso", "left_arm")}
    commands = bench.rig.bus.publisher(keys.COMMANDS, Commands, LATEST)
    orders = {"torso": Order(epochs["torso"], "velocity"), "left_arm": Order(epochs["left_arm"] - 1, "velocity")}
    before = bench.rejected("epoch")

    def send() -> bool:
        commands.put(re_k=bench.clocks[-1].k, parts=orders, ref=[0.0] * len(ROBOT.motors), ttl=1000, answer=None)
        time.sleep(DT)
        return bench.newest("torso").mode == "velocity"

    wait_for(send, "the torso to obey")
    assert bench.newest("left_arm").mode == "hold"
    assert bench.rejected("epoch") > before
    for part in epochs:
        bench.free(part)


def test_every_part_streams_its_motors_at_the_tick_rate_each_at_its_own_phase(bench: Bench) -> None:
    started = {part: len(states) for part, states in bench.states.items()}
    first = bench.clocks[-1].k
    wait_for(lambda: bench.clocks[-1].k >= first + 100, "100 ticks")
    phases = {}
    for part, states in bench.states.items():
        new = states[started[part] :][5:95]
        assert len(new[0].q) == len(ROBOT.part(part))
        assert np.diff([state.k for state in new]).max() == 1
        phases[part] = float(np.mean([state.t / 1e9 / DT - state.k for state in new]))
        assert 0.0 <= phases[part] < 0.9
    assert sum(len(bench.newest(part).q) for part in ROBOT.parts) == 41
    assert min(np.diff(sorted(phases.values()))) > 0.01
    clocks = bench.clocks[-50:]
    assert {clock.dt for clock in clocks} == {10_000_000}
    assert all(clock.t == clock.k * 10_000_000 for clock in clocks)


def test_the_encoders_are_noisy_as_configured(bench: Bench) -> None:
    bench.next_state("left_arm")
    q = np.array([state.q for state in bench.states["left_arm"][-80:]])
    assert np.radians(0.1) * np.sqrt(2) == pytest.approx(q.std(axis=0).mean(), rel=0.2)  # noise is given for 20 ms, this is 10


def test_a_part_tells_what_it_is_made_of(bench: Bench) -> None:
    meta = bench.rig.call(keys.meta("left_arm"), Empty, PartMeta)
    assert tuple(meta.motors) == ROBOT.part("left_arm").motors
    assert np.allclose(np.stack([meta.lower, meta.upper], axis=1), ROBOT.limits[ROBOT.part("left_arm").slice])
    assert meta.max_velocity == pytest.approx([np.radians(60)] * ARM)
    assert meta.robot == "icub"


def test_an_armed_arm_follows_velocities_and_says_which_command_is_in_force(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    before = bench.newest("left_arm").q[ELBOW]
    bench.keep("left_arm", epoch, 0.5, lambda: elbow(0.3))
    state = bench.next_state("left_arm")
    assert state.gate == "armed"
    assert state.epoch == epoch
    assert state.mode == "velocity"
    assert state.cmd_seq >= 0
    assert state.dq[ELBOW] == pytest.approx(0.3, abs=0.02)
    assert 0.08 < state.q[ELBOW] - before < 0.2
    assert bench.newest("right_arm").gate == "idle"


def test_without_new_commands_it_holds_after_the_ttl_within_the_time_that_braking_takes(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    seen = len(bench.events)
    bench.keep("left_arm", epoch, 0.3, lambda: elbow(-0.6), ttl=100)
    wait_for(lambda: any(event.code == "stopped" for event in bench.events[seen:]), "the stop")
    stopped = next(event for event in bench.events[seen:] if event.code == "stopped")
    hold = next(event for event in bench.events[seen:] if "ttl 100 ms" in event.text)  # that it was taken may be told late
    assert bench.newest("left_arm").gate == "hold"
    took, way = stopped.values["time"] * 1e3, np.degrees(stopped.values["distance"])
    print(f"\nstopped {took:.0f} ms after the last tick under command, {way:.2f} deg")
    braking = 0.6 / np.radians(600)
    ticks = int(np.ceil(braking / DT)) + 1
    assert stopped.k - hold.k <= ticks
    assert stopped.values["distance"] < 0.6 * DT + 0.6 * braking
    at_rest = bench.next_state("left_arm").q[ELBOW]
    time.sleep(0.2)
    assert bench.newest("left_arm").q[ELBOW] == pytest.approx(at_rest, abs=0.02)


def test_a_command_that_comes_after_the_hold_is_refused_until_the_part_is_armed_again(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bench.send("left_arm", epoch, elbow(0.1), ttl=20)
    wait_for(lambda: bench.next_state("left_arm").gate == "hold", "the hold")
    before = bench.rejected("not_armed")
    bench.send("left_arm", epoch, elbow(0.1))
    wait_for(lambda: bench.rejected("not_armed") > before, "the refusal")
    assert bench.drive("left_arm", "arm", epoch) == "armed"
    bench.keep("left_arm", epoch, 0.1, lambda: elbow(0.1))
    assert bench.next_state("left_arm").gate == "armed"


@pytest.mark.parametrize("who", ["controller", "model", "router"])
def test_the_arm_holds_at_once_when_a_token_is_gone(bench: Bench, who: str) -> None:
    instance = "rig" if who == "router" else "victim"
    if who != "router":
        bench.rig.token(who, instance)
    bench.free("left_arm")
    epoch = bench.take("left_arm", instance if who == "controller" else "c1")
    wait_for(lambda: _armed(bench, "left_arm", epoch), "arming")
    bench.keep("left_arm", epoch, 0.2, lambda: elbow(0.5))
    seen = len(bench.events)
    bench.rig.drop_token(who, instance)
    wait_for(lambda: any(event.code == "stopped" for event in bench.events[seen:]), "the stop")
    if who == "router":
        bench.rig.token(who, instance)  # in time: without any, the service ends
    codes = [event.code for event in bench.events[seen:]]
    assert codes[:2] == ["hold", "stopped"]
    assert f"{who}" in bench.events[seen].text
    assert bench.next_state("left_arm").gate == "hold"


def _armed(bench: Bench, part: str, epoch: int) -> bool:
    try:
        return bench.drive(part, "arm", epoch) == "armed"
    except CallFailed as error:
        assert error.code == "no_token"
        return False


def test_who_has_no_token_cannot_arm(bench: Bench) -> None:
    bench.free("left_arm")
    epoch = bench.take("left_arm", "nobody")
    with pytest.raises(CallFailed, match="declare it") as caught:
        bench.drive("left_arm", "arm", epoch)
    assert caught.value.code == "no_token"


def test_nobody_takes_a_part_whose_owner_lives(bench: Bench) -> None:
    bench.free("left_arm")
    epoch = bench.arm("left_arm")
    bench.rig.token("controller", "stranger")
    with pytest.raises(CallFailed, match="must release") as caught:
        bench.take("left_arm", "stranger")
    assert caught.value.code == "owned"
    assert bench.drive("left_arm", "arm", epoch) == "armed"
    bench.rig.drop_token("controller", "stranger")


def test_of_two_owners_the_older_can_do_nothing_any_more(bench: Bench) -> None:
    old = bench.arm("left_arm")
    new = bench.arm("left_arm")
    with pytest.raises(CallFailed) as caught:
        bench.drive("left_arm", "hold", old)
    assert caught.value.code == "epoch"
    before, refused = bench.next_state("left_arm").q[ELBOW], bench.rejected("epoch")
    bench.keep("left_arm", old, 0.2, lambda: elbow(0.5))
    assert bench.rejected("epoch") > refused
    assert bench.next_state("left_arm").q[ELBOW] == pytest.approx(before, abs=0.02)
    bench.keep("left_arm", new, 0.3, lambda: elbow(0.5))
    assert bench.next_state("left_arm").q[ELBOW] > before + 0.05
    assert bench.drive("left_arm", "release", new) == "idle"


def test_wrong_commands_are_refused_counted_by_reason_and_move_nothing(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bus, k = bench.rig.bus, bench.clocks[-1].k
    wrong: list[tuple[str, dict[str, Any]]] = [
        ("epoch", {"epoch": epoch - 1, "ref": elbow(0.5)}),
        ("length", {"ref": [0.5] * 3}),
        ("value", {"ref": elbow(float("nan"))}),
        ("value", {"ref": elbow(float("inf"))}),
        ("velocity", {"ref": elbow(2.0)}),
        ("position", {"ref": [9.0] * ARM, "mode": "position"}),
        ("step", {"ref": bench.newest("left_arm").q[:ELBOW] + [0.5] + bench.newest("left_arm").q[ELBOW + 1 :], "mode": "position"}),
        ("torque", {"ref": elbow(400.0), "mode": "torque"}),
        ("future", {"ref": elbow(0.5), "re_k": k + 10**6}),
        ("age", {"ref": elbow(0.5), "re_k": max(0, k - 50)}),
    ]
    before = bench.next_state("left_arm").q
    for reason, fields in wrong:
        counted = bench.rejected(reason)
        bench.send("left_arm", fields.pop("epoch", epoch), fields.pop("ref"), **fields)
        wait_for(lambda reason=reason, counted=counted: bench.rejected(reason) == counted + 1, reason)
    run, bus.run = bus.run, "another_run"
    counted = bench.rejected("run")
    bench.send("left_arm", epoch, elbow(0.5))
    bus.run = run
    wait_for(lambda: bench.rejected("run") == counted + 1, "run")
    assert bench.next_state("left_arm").q == pytest.approx(before, abs=0.02)
    refused = [event for event in bench.events if event.code == "refused"]
    assert any("epoch" in event.text for event in refused)


def test_a_replayed_command_is_refused(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    k = bench.clocks[-1].k
    header = {"v": VERSION, "run": bench.rig.bus.run, "src": "x", "seq": 10**6, "k": k, "t": 0, "tw": 0}
    payload = encode(Command(**header, epoch=epoch, re_k=k, mode="velocity", ref=elbow(0.0), ttl=100))  # type: ignore[arg-type]
    counted = bench.rejected("seq")
    for _ in range(2):
        bench.rig.session.put(keys.command("left_arm"), payload, encoding=encoding_of(Command))
        time.sleep(0.03)  # each is handled before the next comes
    wait_for(lambda: bench.rejected("seq") == counted + 1, "the refusal")


def test_random_bytes_on_every_key_move_nothing_and_kill_nothing(bench: Bench, rng: np.random.Generator) -> None:
    epoch = bench.arm("left_arm")
    streams: list[tuple[str, type[Message]]] = [(keys.command(part), Command) for part in ROBOT.parts] + [(keys.ESTOP, EStop)]
    calls: list[tuple[str, type[Request]]] = [(keys.drive(part, "take"), Take) for part in ("left_arm", "*", "nobody")]
    calls += [(keys.drive("left_arm", verb), WithEpoch) for verb in ("arm", "release", "hold")] + [(keys.sim("place"), Place)]
    calls += [(keys.sim(verb), Empty) for verb in ("reset", "pause", "resume")]
    calls += [(keys.service_rpc("robot_sim", verb), Empty) for verb in ("stat", "mark", "config", "shutdown")]
    calls += [(keys.ESTOP_RESET, Empty), (keys.meta("torso"), Empty)]
    run, before = bench.clocks[-1].run, {part: bench.next_state(part).q for part in ROBOT.parts}
    header = {"v": VERSION, "run": run, "src": "x", "seq": 5, "k": 1, "t": 1, "tw": 1}
    good = encode(Command(**header, epoch=epoch, re_k=10**9, mode="velocity", ref=elbow(1.0), ttl=100))  # type: ignore[arg-type]
    refused = sum(bench.rig.stat("robot_sim").rejected.values())
    for number in range(2000):
        noise = rng.bytes(int(rng.integers(0, 200)))
        if number % 2:
            broken = bytearray(good)
            for at in rng.integers(0, len(good), 3):
                broken[at] = int(rng.integers(0, 256))
            noise = bytes(broken)
        is_call = number % 4 == 0
        key, cls = calls[number // 4 % len(calls)] if is_call else streams[number % len(streams)]
        encoding = encoding_of(cls) if number % 3 else str(rng.choice(["", "text/plain", "application/msgpack;icub/Command/99"]))
        if is_call:
            assert all(answer.ok is None for answer in bench.rig.session.get(key, payload=noise, encoding=encoding, timeout=0.5))
        else:
            bench.rig.session.put(key, noise, encoding=encoding)
        if number % 20 == 0:
            time.sleep(0.001)  # the newest of a burst is all that is looked at
    stat = bench.rig.stat("robot_sim")
    assert bench.program.is_running
    assert bench.clocks[-1].run == run
    assert sum(stat.rejected.values()) > refused + 100
    for part, q in before.items():
        assert bench.next_state(part).q == pytest.approx(q, abs=0.03)
        assert bench.newest(part).gate != "estop"
    bench.keep("left_arm", bench.arm("left_arm"), 0.2, lambda: elbow(0.1))
    assert bench.next_state("left_arm").gate == "armed"


def test_position_mode_goes_where_the_reference_goes(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    state = {"q": list(bench.newest("left_arm").q)}
    start = state["q"][ELBOW]

    def reference() -> list[float]:
        if state["q"][ELBOW] > start - 0.2:
            state["q"][ELBOW] -= 0.3 * DT
        return state["q"]

    bench.keep("left_arm", epoch, 1.6, reference, mode="position")
    reached = bench.next_state("left_arm")
    assert reached.mode == "position"
    assert reached.q[ELBOW] == pytest.approx(state["q"][ELBOW], abs=0.02)


def test_torque_mode_accelerates_a_motor(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    arm = ROBOT.part("left_arm").slice

    def carry_and_bend() -> list[float]:
        q = ROBOT.home.copy()
        q[arm] = bench.newest("left_arm").q
        return (gravity_torque(ROBOT, q)[arm] + elbow(1.0)).tolist()

    bench.keep("left_arm", epoch, 0.5, carry_and_bend, mode="torque")
    state = bench.next_state("left_arm")
    assert state.mode == "torque"
    assert state.dq[ELBOW] == pytest.approx(1.0 / 5.0, abs=0.02)  # where friction, 5 N m s/rad, balances it
    assert state.tau[ELBOW] == pytest.approx(1.0, abs=0.1)


def test_an_emergency_stop_latches_until_it_is_reset(bench: Bench) -> None:
    stops = bench.rig.record(keys.ESTOP, EStop)
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.2, lambda: elbow(0.3))
    bench.rig.bus.publisher(keys.ESTOP, EStop, LATEST).put(set=True, source="test", reason="because")
    wait_for(lambda: all(bench.newest(part).gate == "estop" for part in ROBOT.parts), "the stop")
    with pytest.raises(CallFailed) as caught:
        bench.drive("left_arm", "arm", epoch)
    assert caught.value.code == "estop"
    wait_for(lambda: sum(stop.src == "robot_sim" for stop in stops) >= 3, "its repetition")
    assert abs(bench.newest("left_arm").dq[ELBOW]) < 0.01
    bench.rig.call(keys.ESTOP_RESET, Empty, Done)
    assert bench.next_state("left_arm").gate == "hold"
    assert bench.drive("left_arm", "arm", epoch) == "armed"
    time.sleep(0.25)
    assert bench.next_state("torso").gate == "hold"


def test_while_it_is_paused_no_time_passes_and_afterwards_it_holds(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.1, lambda: elbow(0.3))
    bench.rig.call(keys.sim("pause"), Empty, Done)
    wait_for(lambda: bench.clocks[-1].mode == "paused", "the pause")
    k = bench.clocks[-1].k
    time.sleep(0.1)
    assert bench.clocks[-1].k == k
    bench.rig.call(keys.sim("resume"), Empty, Done)
    assert bench.next_state("left_arm").gate == "hold"
    assert bench.clocks[-1].mode == "free"


def test_an_object_is_placed_and_the_truth_says_so(bench: Bench) -> None:
    bench.rig.call(keys.sim("place"), Place, Done, name="ball", position=[-0.3, 0.1, 0.2])
    wait_for(lambda: {o.name: o.position for o in bench.truths[-1].objects}["ball"] == [-0.3, 0.1, 0.2], "the ball")
    assert len(bench.truths[-1].q) == 41
    with pytest.raises(CallFailed, match="'ball'"):
        bench.rig.call(keys.sim("place"), Place, Done, name="bal", position=[0.0, 0.0, 0.0])


def test_a_reset_is_a_new_run_at_home_in_which_nobody_owns_anything(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.4, lambda: elbow(0.6))
    run = bench.clocks[-1].run
    bench.rig.call(keys.sim("reset"), Empty, Done)
    bench.follow()
    assert bench.clocks[-1].run != run
    state = bench.next_state("left_arm")
    assert state.run == bench.clocks[-1].run
    assert state.gate == "idle"
    home = ROBOT.home[ROBOT.part("left_arm").slice]
    assert state.q == pytest.approx(home, abs=0.02)
    with pytest.raises(CallFailed) as caught:
        bench.drive("left_arm", "arm", epoch)
    assert caught.value.code == "epoch"
    assert bench.take("left_arm") > epoch


def test_mark_starts_a_new_count_and_the_age_of_every_tick_is_in_it(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.2, lambda: elbow(0.0))
    bench.rig.call(keys.service_rpc("robot_sim", "mark"), Empty, Done)
    bench.keep("left_arm", epoch, 0.5, lambda: elbow(0.0))
    numbers = bench.numbers()
    assert 40 <= numbers["ticks"] <= 70
    assert numbers["age_p50"] >= 1
    assert numbers["armed_ticks"] + numbers["hold_ticks"] == numbers["ticks"]


@pytest.mark.parametrize(("rate", "backend"), [(200, "pybullet"), (1000, "kinematic")])
def test_it_runs_at_other_rates(tmp_path: Path, rate: int, backend: str) -> None:
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", backend, "--rate", str(rate))
        time.sleep(0.5)  # start-up is over
        bench.rig.call(keys.service_rpc("robot_sim", "mark"), Empty, Done)
        epoch = bench.arm("left_arm")
        bench.keep("left_arm", epoch, 1.0, lambda: elbow(0.2))
        assert bench.next_state("left_arm").gate == "armed"
        clocks = bench.clocks[-100:]
        assert {clock.dt for clock in clocks} == {10**9 // rate}
        numbers = bench.numbers()
        print(
            f"\n{backend} {rate} Hz: "
            + ", ".join(f"{name} {value:.3g}" for name, value in numbers.items() if name.endswith(("p50", "p99", "_ticks")))
        )
        assert numbers["ticks"] > 0.3 * rate


def test_physics_stops_a_hand_at_the_table_and_the_truth_tells_the_depth(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", "pybullet")
        wait_for(lambda: bench.truths, "the truth")
        assert bench.truths[-1].depth == 0.0
        assert 0.05 < bench.truths[-1].gap < 0.12
        epoch = bench.arm("torso")
        bench.keep("torso", epoch, 1.5, lambda: [0.0, 0.0, 0.4])
        assert any(0.0 < truth.depth < 0.01 and truth.pair in ("l_hand table", "r_hand table") for truth in bench.truths)
        assert bench.truths[-1].gap == 0.0
        numbers = bench.numbers()
        assert numbers["solid_ticks"] > 0
        assert 0.0 < numbers["solid_depth_max"] < 0.01
        assert numbers["pairs_watched"] > 200
        started = time.monotonic()
        assert bench.program.stop(signal.SIGTERM) == 0
        print(f"\nended {time.monotonic() - started:.3f} s after SIGTERM")


def test_a_new_process_is_a_new_run_in_which_no_old_epoch_fits(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", "kinematic")
        epoch, run = bench.arm("left_arm"), bench.clocks[-1].run
        bench.program.stop(signal.SIGKILL)
        bus.start("services.robot_sim", "robot_sim", "--backend", "kinematic")
        bench.follow()
        assert bench.clocks[-1].run != run
        assert bench.next_state("left_arm").gate == "idle"
        assert bench.take("left_arm") > epoch


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--backend", "bullet"], "bullet"),
        (["--rate", "0"], "rate"),
        (["--robot", "icup"], "'icub'"),
        (["--world", "tabel", "--backend", "kinematic"], "'table'"),
        (["--robot", "icub_2014"], "kinematic"),
    ],
)
def test_a_setting_that_cannot_be_used_is_told_at_once(tmp_path: Path, arguments: list[str], says: str) -> None:
    with rig(tmp_path, ROBOT) as bus:
        program = bus.spawn("-m", "services.robot_sim", "--endpoint", free_endpoint(), *arguments)
        assert program.wait(10.0) == 2
        assert says in program.says


def test_a_typo_in_the_file_is_told_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "robot_sim.toml"
    file.write_text('backend = "kinematic"\nrat = 100\n')
    with rig(tmp_path, ROBOT) as bus:
        program = bus.spawn("-m", "services.robot_sim", "--config", str(file))
        assert program.wait(10.0) == 2
        assert f"{file}:2: unknown field 'rat'. Did you mean 'rate'?" in program.says
