# SPDX-License-Identifier: Apache-2.0
"""What the process says with every tick, and of itself."""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import Clock, Commands, Order, Tick
from bus_schema.rpc import Done, Empty, PartMeta, Place
from services.common.rpc import CallFailed
from tests.services.harness import rig, wait_for
from tests.services.robot_sim.bench import ARM, DT, ROBOT, Bench, elbow


def test_a_tick_holds_what_each_part_said_last(bench: Bench) -> None:
    ticks = bench.rig.record(Tick)
    wait_for(lambda: len(ticks) > 10, "ticks")
    tick = ticks[5]
    for part, states in bench.states.items():
        said = (tick.run, tick.parts[part].t)  # runs before this one had the same times
        state = wait_for(lambda s=states, said=said: next((x for x in s if (x.run, x.t) == said), None), f"the state of {part}")
        assert (state.k, state.gate, state.epoch) == (tick.parts[part].k, tick.parts[part].gate, tick.parts[part].epoch)
        assert state.k == tick.k - 1
        assert state.q == tick.q[ROBOT.part(part).slice]


def test_the_clock_is_published_at_most_a_hundred_times_per_second_and_ticks_always(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as bus:
        ticks, clocks = bus.record(Tick), bus.record(Clock)
        bus.start("services.robot_sim", "robot_sim", "--backend", "kinematic", "--rate", "400")
        wait_for(lambda: len(ticks) > 100 and len(clocks) > 20, "ticks")
        assert {clock.k % 4 for clock in clocks} == {0}
        assert min(after.k - before.k for before, after in pairwise(ticks)) == 1


def test_orders_to_all_parts_come_in_one_message_and_refusals_concern_a_part(bench: Bench) -> None:
    epochs = {part: bench.arm(part) for part in ("torso", "left_arm")}
    commands = bench.rig.bus.publisher(Commands)
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
    wait_for(lambda: all(bench.newest(part).k >= first + 100 for part in ROBOT.parts), "100 ticks")
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


def test_the_metadata_of_a_part_are_its_motors_and_limits(bench: Bench) -> None:
    meta = bench.rig.call(keys.meta("left_arm"), Empty, PartMeta)
    assert tuple(meta.motors) == ROBOT.part("left_arm").motors
    assert np.allclose(np.stack([meta.lower, meta.upper], axis=1), ROBOT.limits[ROBOT.part("left_arm").slice])
    assert meta.max_velocity == pytest.approx([np.radians(60)] * ARM)
    assert meta.robot == "icub"


def test_an_object_is_placed_and_the_truth_says_so(bench: Bench) -> None:
    bench.rig.call(keys.sim("place"), Place, Done, name="ball", position=[-0.3, 0.1, 0.2])
    wait_for(lambda: {o.name: o.position for o in bench.truths[-1].objects}["ball"] == [-0.3, 0.1, 0.2], "the ball")
    assert len(bench.truths[-1].q) == 41
    with pytest.raises(CallFailed, match="'ball'"):
        bench.rig.call(keys.sim("place"), Place, Done, name="bal", position=[0.0, 0.0, 0.0])


def test_mark_starts_a_new_count_and_the_age_of_every_tick_is_in_it(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.2, lambda: elbow(0.0))
    before = bench.now()
    bench.rig.call(keys.service_rpc("robot_sim", "mark"), Empty, Done)
    after = bench.now()
    end = bench.keep("left_arm", epoch, 0.5, lambda: elbow(0.0)).k
    numbers = bench.numbers()
    assert end - after <= numbers["ticks"] <= bench.now() - before
    assert numbers["age_p50"] >= 1
    assert numbers["armed_ticks"] + numbers["hold_ticks"] == numbers["ticks"]
