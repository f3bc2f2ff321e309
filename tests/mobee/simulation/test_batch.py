# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pickle
import signal
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mobee import BatchInterrupted, advance_together, run_together, sphere
from mobee.control import Gains, Term
from mobee.errors import ActionInterrupted, InvalidValue
from mobee.model.model import Model
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.reach import ReachTarget
from mobee.robot.load import load_robot
from mobee.simulation import OfflinePlant, run_batch
from tests.mobee.control.two_parts import two_part_arm


def hash_of(seed: int) -> str:
    """What an arm does under a seed."""
    plant = OfflinePlant(Model(two_part_arm()), seed, hashed=True)
    plant.act("arm", np.array([0.4, -0.3]))
    return plant.hash


def refuse(seed: int) -> None:
    raise InvalidValue(f"seed {seed} is not liked")


def test_a_batch_is_its_plants_one_after_the_other() -> None:
    seeds = [5, 3, 4]
    alone = [hash_of(seed) for seed in seeds]
    assert len(set(alone)) == 3
    assert run_batch(hash_of, seeds, processes=2) == alone
    assert run_batch(hash_of, seeds, processes=1) == alone


def test_an_exception_in_a_plant_is_raised() -> None:
    with pytest.raises(InvalidValue, match="seed 3 is not liked"):
        run_batch(refuse, [3, 4], processes=2)


def test_no_seeds_no_results() -> None:
    assert run_batch(hash_of, []) == []


@pytest.mark.parametrize("processes", [0, -1, 1.5, True])
def test_an_invalid_number_of_processes_is_refused(processes: int) -> None:
    with pytest.raises(InvalidValue, match="processes"):
        run_batch(hash_of, [1, 2], processes=processes)


ICUB, ICUB_2014, KATANA = (load_robot(name) for name in ("icub", "icub_2014", "katana"))


TABLE = load_world("table")  # of all plants that share a world


PRESS = {"torso": (0.5, 0.5, 0.9), "left_arm": (0.6, 0.3, 0.5, 0.4, 0.5, 0.5, 0.5), "right_arm": (0.5, 0.2, 0.5, 0.5, 0.5, 0.5, 0.5)}


REACHING = 12  # the seed of the plant that reaches


THREADS = pytest.mark.parametrize("threads", [1, 2, 3])


def goal(plant: OfflinePlant, part: str, share: Any) -> Any:
    low, high = plant.robot.limits[plant.robot.parts[part].slice].T
    return low + share * (high - low)


def viscous(state: Any) -> Any:
    return -0.5 * state.velocity


def plants() -> list[OfflinePlant]:
    """Of all kinds, in the order in which nothing is like its neighbour; each keeps its hash."""
    own = [
        OfflinePlant(Model(KATANA), 3, hashed=True),
        OfflinePlant(Model(ICUB, load_world("table")), 4, dt=0.02, active=["torso", "*_arm"], hashed=True),
        OfflinePlant(Model(ICUB, TABLE), 5, Gains.published_2014(), dt=0.02, active=["left_arm"], propagate="part", hashed=True),
        OfflinePlant(Model(KATANA), 6, modality="position", command_age=3, hashed=True),
        OfflinePlant(Model(ICUB_2014, TABLE), 7, Gains.published_2014(), dt=0.02, active=["l_shoulder_*", "l_elbow"], hashed=True),
        OfflinePlant(Model(KATANA), 8, modality="torque", dt=0.02, hashed=True),
        OfflinePlant(Model(KATANA), 9, dt=0.02, terms=[Term("viscous", viscous)], hashed=True),
        OfflinePlant(Model(ICUB_2014, TABLE), 10, dt=0.02, active=["right_arm"]),
    ]
    ball = World()
    ball.add("ball", sphere(0.05), position=(0.3, 0.0, 0.3))
    called = OfflinePlant(Model(KATANA, ball), 11, hashed=True)
    called.every(25, lambda time: ball.move("ball", position=(0.3, 0.1 * np.sin(time), 0.3)))
    reaching = OfflinePlant(Model(ICUB), REACHING, dt=0.02, active=["left_arm"], hashed=True)
    return [*own, called, reaching]


def begin(every: list[OfflinePlant], number: int) -> None:
    """The actions of a round, several parts at once where they live."""
    for index, plant in enumerate(every):
        shares = 0.2 + 0.6 * ((number + 1) * (index + 2) * 0.381966 % 1.0)
        for part, its in plant.robot.parts.items():
            if part in plant.acting or not np.isin(np.arange(its.start, its.start + len(its)), plant.motors.living).any():
                continue
            if plant.robot is ICUB and plant.motors.seed == REACHING:
                plant.present(ReachTarget(np.array([-0.25, -0.2, 0.1 + 0.1 * number])))
                plant.begin_reach(part, "left_palm")
            else:
                plant.begin(part, goal(plant, part, np.resize(PRESS.get(part, 0.5), len(its)) if number == 2 else shares))


def plain(outcomes: list[tuple[str, Any]]) -> list[Any]:
    return [(part, one.q.tolist(), one.settled, one.duration, one.touched) for part, one in outcomes]


@pytest.fixture(scope="module")
def one_after_the_other() -> tuple[list[Any], list[Any], list[OfflinePlant]]:
    """Three rounds of actions, then a trace of each."""
    alone = plants()
    ended = []
    for number in range(3):
        begin(alone, number)
        ended.append([plain(plant.advance()) for plant in alone])
    return ended, [plant.run(60) for plant in alone], alone


@THREADS
def test_together_is_one_after_the_other_to_the_last_bit(threads: int, one_after_the_other: Any) -> None:
    ended, traces, alone = one_after_the_other
    together = plants()
    for number in range(3):
        begin(together, number)
        assert [plain(outcomes) for outcomes in advance_together(together, threads)] == ended[number]
    for found, expected in zip(run_together(together, 60, threads), traces, strict=True):
        for name in ("encoders", "q", "velocity", "solid", "field"):
            assert np.array_equal(getattr(found, name), getattr(expected, name))
    assert max(trace.field.max() for trace in traces) > 0.0, "some field has a contact"
    for mine, theirs in zip(together, alone, strict=True):
        assert (mine.time, mine.acting) == (theirs.time, theirs.acting)
        assert np.array_equal(mine.motors.q, theirs.motors.q)
    assert [plant.hash for plant in together[:7]] == [plant.hash for plant in alone[:7]]
    assert [plant.hash for plant in together[8:]] == [plant.hash for plant in alone[8:]]


@THREADS
def test_many_plants_of_one_robot_share_a_world_and_which_are_together_does_not_matter(threads: int) -> None:
    def made() -> list[OfflinePlant]:
        return [OfflinePlant(Model(ICUB_2014, TABLE), seed, dt=0.02, active=["left_arm"], hashed=True) for seed in range(9)]

    alone, together = made(), made()
    for number in range(2):
        begin(alone, number)
        begin(together, number)
        for plant in alone:
            plant.advance()
        advance_together(together[number:], threads)
        advance_together(together[:number], threads)
    assert [plant.hash for plant in together] == [plant.hash for plant in alone]


def test_a_shared_world_follows_the_last_plant() -> None:
    world = World()
    world.add("cup", sphere(0.02), position=(0.3, 0.0, 0.3))
    robots = [OfflinePlant(Model(KATANA, world), seed) for seed in range(3)]
    part = next(iter(KATANA.parts))
    for plant, share in zip(robots, (0.2, 0.9, 0.5), strict=True):
        plant.begin(part, goal(plant, part, share))
    advance_together(robots)
    world.attach("cup", KATANA.links[-1])
    relative = world.objects["cup"].position
    pose = robots[-1].pose
    assert pose is not None
    world.detach("cup")
    carrier = pose.transforms[-1]
    assert np.allclose(carrier[:3, :3] @ relative + carrier[:3, 3], (0.3, 0.0, 0.3))


def test_nothing_is_done_by_no_plants() -> None:
    assert advance_together([]) == []
    assert run_together([], 10) == []
    trace = run_together(iter([OfflinePlant(Model(KATANA))]), 0)[0]
    assert len(trace) == 0


def katanas(count: int, world: World | None = None, acting: bool = True) -> list[OfflinePlant]:
    part = next(iter(KATANA.parts))
    made = [OfflinePlant(Model(KATANA, world), seed, hashed=True) for seed in range(count)]
    for plant in made if acting else []:
        plant.begin(part, goal(plant, part, 0.6))
    return made


def calling(plant: OfflinePlant, function: Callable[[float], None] = lambda time: None) -> OfflinePlant:
    plant.every(7, function)
    return plant


def reaching(world: World | None = None) -> OfflinePlant:
    plant = OfflinePlant(Model(ICUB, world), active=["left_arm"])
    plant.present(ReachTarget(np.array([-0.25, -0.2, 0.1])))
    plant.begin_reach("left_arm", "left_palm")
    return plant


@pytest.mark.parametrize("together", [advance_together, lambda given, threads=1: run_together(given, 5, threads)], ids=["advance", "run"])
def test_incompatible_plants_are_refused_before_any_moves(together: Any) -> None:
    good, world = katanas(2), World()
    for given, message in (
        ([*good, good[0]], r"plants\[2\] is plants\[0\] again"),
        ([*good, "katana"], r"plants\[2\] is 'katana'; it must be an OfflinePlant"),
        ([*good, *katanas(2, world)[:1], calling(katanas(1, world)[0])], r"plants\[3\].*give each a Model of its own"),
        ([*good, *katanas(2, world)[:1], reaching(world)], r"plants\[3\].*give each a Model of its own"),
    ):
        with pytest.raises(InvalidValue, match=message):
            together(given)
    for threads in (0, -1, True, 1.0, 10_000):
        with pytest.raises(InvalidValue, match="threads="):
            together(good, threads=threads)
    assert [plant.time for plant in good] == [0.0, 0.0]
    assert together([*good, calling(katanas(1)[0]), reaching()]), "each in a world of its own"


def test_a_plant_without_an_action_and_invalid_numbers_of_ticks_are_refused() -> None:
    good = katanas(1)
    with pytest.raises(InvalidValue, match=r"plants\[1\]: no part of it is acting"):
        advance_together([*good, *katanas(1, acting=False)])
    for ticks in (-1, 1.5, True):
        with pytest.raises(InvalidValue, match="ticks="):
            run_together(good, ticks)  # type: ignore[arg-type]  # 1.5 is of a wrong type
    assert good[0].time == 0.0


def losing(plant: OfflinePlant) -> OfflinePlant:
    """Its motors' state is not finite any more."""
    plant.motors.state["q"][:] = np.nan
    return plant


@THREADS
def test_a_plant_that_is_lost_takes_nothing_from_the_others(threads: int) -> None:
    alone, together = katanas(5), katanas(5)
    for lost in (together[1], together[3]):
        losing(lost)
    with pytest.raises(BatchInterrupted, match=r"2 of 5 plants were interrupted, the first plants\[1\]: the motors' state") as caught:
        advance_together(together, threads)
    results: list[Any] = caught.value.results
    assert caught.value.__cause__ is results[1]
    assert [isinstance(one, ActionInterrupted) for one in results] == [False, True, False, True, False]
    for number in (0, 2, 4):
        assert plain(results[number]) == plain(alone[number].advance())
        assert together[number].hash == alone[number].hash
        assert together[number].acting == ()
    assert together[1].acting == (), "as after its own advance"
    sent = pickle.loads(pickle.dumps(caught.value))
    assert str(sent) == str(caught.value)
    assert plain(sent.results[0]) == plain(results[0])


def test_a_function_that_raises_takes_nothing_from_the_others() -> None:
    def fail(time: float) -> None:
        raise ZeroDivisionError(f"at {time:.2f} s")

    alone, together = katanas(3), katanas(3)
    calling(together[0], fail)
    with pytest.raises(BatchInterrupted, match=r"1 of 3 plants.*plants\[0\]: at 0.07 s") as caught:
        run_together(together, 2500)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    for number in (1, 2):
        trace: Any = caught.value.results[number]
        assert np.array_equal(trace.q, alone[number].run(2500).q)
        assert together[number].hash == alone[number].hash
    assert together[0].time == pytest.approx(0.07)
    together[0].every(1, None)
    run_together(together, 10)
    assert together[0].time == pytest.approx(0.17), "it can continue"


@pytest.mark.parametrize("count", [1, 3])
def test_after_a_ctrl_c_plants_continue_from_the_last_tick(count: int) -> None:
    def made() -> list[OfflinePlant]:
        return [OfflinePlant(Model(KATANA), seed) for seed in range(count)]

    interrupted, alone = made(), made()
    main = threading.main_thread().ident
    assert main is not None
    threading.Timer(0.1, signal.pthread_kill, (main, signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        if count == 1:
            interrupted[0].run(10**9)
        else:
            run_together(interrupted, 10**9, threads=2)
    for stopped, other in zip(interrupted, alone, strict=True):
        ticks = round(stopped.time / stopped.dt)
        assert ticks > 0
        other.run(ticks)
        assert stopped.run(50).q.tobytes() == other.run(50).q.tobytes()
