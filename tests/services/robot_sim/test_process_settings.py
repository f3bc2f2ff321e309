# SPDX-License-Identifier: Apache-2.0
"""Processes with other rates, back-ends and settings."""

from __future__ import annotations

import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import EStop
from bus_schema.rpc import Done, Empty, PartMeta
from experiments.kit.live.launch import free_endpoint
from services.common.emergency_stop import Stop, StopDatagrams, StopRecord, StopSender
from services.common.rpc import CallFailed
from services.common.worlds import robot_hash
from tests.services.harness import rig, wait_for
from tests.services.robot_sim.bench import ROBOT, Bench, elbow


@pytest.mark.parametrize(("rate", "backend"), [(200, "pybullet"), (200, "mujoco"), (1000, "kinematic")])
def test_it_runs_at_other_rates(tmp_path: Path, rate: int, backend: str) -> None:
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", backend, "--rate", str(rate))
        time.sleep(0.5)  # start-up is over
        bench.rig.call(keys.service_rpc("robot_sim", "mark"), Empty, Done)
        epoch = bench.arm("left_arm")
        assert bench.keep("left_arm", epoch, 1.0, lambda: elbow(0.2)).gate == "armed"
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


def test_encoders_have_the_errors_that_are_set_and_the_truth_has_none(tmp_path: Path) -> None:
    settings = tmp_path / "errors.toml"
    settings.write_text('backend = "kinematic"\nencoder_errors = { l_elbow = 0.09 }\n')
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--config", str(settings))
        index, where = ROBOT.motor_index("l_elbow"), ROBOT.part("left_arm").slice
        wait_for(lambda: bench.truths and bench.now() > 20, "ticks")
        errors = np.array(bench.newest("left_arm").q) - np.array(bench.truths[-1].q)[where]
        assert errors[index - where.start] == pytest.approx(0.09, abs=0.015)
        assert np.delete(errors, index - where.start) == pytest.approx(0.0, abs=0.015)


def test_the_largest_torques_that_are_set_are_those_of_gate_and_metadata(tmp_path: Path) -> None:
    settings = tmp_path / "torques.toml"
    settings.write_text('backend = "kinematic"\ntorques = { l_elbow = 0.5 }\n')
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--config", str(settings))
        meta = bus.call(keys.meta("left_arm"), Empty, PartMeta)
        assert meta.max_torque == pytest.approx([0.5 if motor == "l_elbow" else 40.0 for motor in meta.motors])
        assert meta.robot_hash == robot_hash(ROBOT)  # the controller has the robot's file
        epoch = bench.arm("left_arm")
        bench.refuses("torque", lambda: bench.send("left_arm", epoch, elbow(0.6), mode="torque"))


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
        (["--robot", "icub_2014", "--backend", "pybullet"], "mujoco"),
    ],
)
def test_a_setting_that_cannot_be_used_is_reported_at_once(tmp_path: Path, arguments: list[str], says: str) -> None:
    with rig(tmp_path, ROBOT) as bus:
        program = bus.spawn("-m", "services.robot_sim", "--endpoint", free_endpoint(), *arguments)
        assert program.wait(10.0) == 2
        assert says in program.says


def test_a_typo_in_the_file_is_reported_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "robot_sim.toml"
    file.write_text('backend = "kinematic"\nrat = 100\n')
    with rig(tmp_path, ROBOT) as bus:
        program = bus.spawn("-m", "services.robot_sim", "--config", str(file))
        assert program.wait(10.0) == 2
        assert f"{file}:2: unknown field 'rat'. Did you mean 'rate'?" in program.says


def test_a_stop_outlives_the_process_and_that_of_a_client_replaces_that_of_the_launcher(tmp_path: Path) -> None:
    record = StopRecord(tmp_path / "stop.json")
    record.create()
    options = ("--backend", "kinematic", "--stop-record", str(record.path))
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, *options)
        stops = bus.bus.publisher(EStop)
        for source in ("launcher", "a_person", "launcher"):
            stops.put(set=True, source=source, reason="test")
            wait_for(lambda: bench.next_state("torso").gate == "estop", "the stop")
        wait_for(lambda: (kept := record.read()) is not None and kept.source == "a_person", "the stop of the client in the record")
        bench.program.stop(signal.SIGKILL)
        bus.start("services.robot_sim", "robot_sim", *options)
        bench.follow()
        assert {bench.next_state(part).gate for part in ROBOT.parts} == {"estop"}
        bus.call(keys.ESTOP_RESET, Empty, Done)
        assert record.read() is None
        assert bench.next_state("torso").gate == "hold"


def test_a_stop_in_the_record_is_obeyed_without_a_message(tmp_path: Path) -> None:
    record = StopRecord(tmp_path / "stop.json")
    record.create()
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", "kinematic", "--stop-record", str(record.path))
        stop = Stop("mobee", "a hand in the way", time.time())
        record.latch(stop)
        wait_for(lambda: all(bench.next_state(part).gate == "estop" for part in ROBOT.parts), "the stop")
        assert record.read() == stop
        bus.call(keys.ESTOP_RESET, Empty, Done)
        assert record.read() is None
        assert bench.next_state("torso").gate == "hold"


def test_a_stop_that_comes_as_a_datagram_is_obeyed_recorded_and_confirmed(tmp_path: Path, free_port: int) -> None:
    record = StopRecord(tmp_path / "stop.json")
    record.create()
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", "kinematic", "--stop-record", str(record.path), "--stop-address", f"127.0.0.1:{free_port}")
        with StopSender(f"tcp/127.0.0.1:{free_port}", "mobee", "a hand in the way") as sender:
            sender.send()
            wait_for(sender.is_confirmed, "the confirmation")
        assert {bench.next_state(part).gate for part in ROBOT.parts} == {"estop"}
        stop = record.read()
        assert stop is not None and (stop.source, stop.reason) == ("mobee", "a hand in the way")
        bus.call(keys.ESTOP_RESET, Empty, Done)
        assert bench.next_state("torso").gate == "hold"


def test_an_address_for_stops_that_is_in_use_is_reported_and_the_bus_remains(tmp_path: Path, free_port: int) -> None:
    other = StopDatagrams(f"127.0.0.1:{free_port}")
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", "kinematic", "--stop-address", f"127.0.0.1:{free_port}")
        bench.hears("stop_address", 0, "from bus and record")
        bench.rig.bus.publisher(EStop).put(set=True, source="test", reason="because")
        wait_for(lambda: bench.next_state("torso").gate == "estop", "the stop")
    other.close()


def test_a_stop_that_cannot_be_recorded_holds_and_is_reported(tmp_path: Path) -> None:
    record = StopRecord(tmp_path / "states" / "stop.json")
    record.create()
    with rig(tmp_path, ROBOT) as bus:
        bench = Bench(bus, "--backend", "kinematic", "--stop-record", str(record.path))
        shutil.rmtree(record.path.parent)
        bench.rig.bus.publisher(EStop).put(set=True, source="test", reason="because")
        wait_for(lambda: all(bench.newest(part).gate == "estop" for part in ROBOT.parts), "the stop")
        bench.hears("estop_record", 0, "the stop holds, but")
        with pytest.raises(CallFailed) as caught:
            bench.rig.call(keys.ESTOP_RESET, Empty, Done)
        assert caught.value.code == "estop_record"
        assert {bench.next_state(part).gate for part in ROBOT.parts} == {"estop"}
