# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.control.reflex import Reflex, ReflexSettings, Violation
from mobee.errors import InvalidValue

DT = 0.01
FAST = np.array([1000.0, 1000.0])  # rad/s: no target is held back
WALL = (Violation("contact", "hand - wall", 0.01),)
OTHER = (Violation("contact", "elbow - hip", 0.02),)
NOTHING: tuple[Violation, ...] = ()


def quick(**changes: float | bool) -> ReflexSettings:
    """Without times, but for those that a test is about."""
    times = dict.fromkeys(("confirm", "release", "brake", "dead_time"), 0.0)
    return ReflexSettings(**{**times, **changes})


def at(x: float) -> Array:
    return np.array([x, -x])


def walk(reflex: Reflex, *places: float) -> None:
    for x in places:
        assert reflex.tick(at(x), NOTHING) is None


def rewind(reflex: Reflex, limit: int = 1000) -> list[float]:
    """Positions of a robot that follows the targets at once, in contact from 5 on, until the client has control again."""
    went: list[float] = []
    x = 6.0
    while (target := reflex.tick(at(x), WALL if x >= 5 else NOTHING)) is not None:
        x = float(target[0])
        went.append(x)
        assert len(went) < limit
    return went


@pytest.mark.parametrize("velocity", [0.0, -1.0, np.nan])
def test_a_rewind_that_would_not_move_is_refused(velocity: float) -> None:
    with pytest.raises(InvalidValue, match="max_velocity .*above 0 for each motor"):
        Reflex(quick(), DT, np.array([1.0, velocity]))


@pytest.mark.parametrize("q", [np.array([0.0, np.nan]), np.zeros(3), np.zeros((1, 2))], ids=["nan", "long", "batch"])
def test_a_pose_that_is_none_is_not_recorded(q: np.ndarray) -> None:
    """Else the robot would retrace it."""
    reflex = Reflex(quick(), DT, FAST)
    with pytest.raises(InvalidValue, match=r"q.*2 finite numbers"):
        reflex.tick(q, ())
    assert reflex.recorded == 0


def test_the_robot_retraces_its_path_to_the_waypoint() -> None:
    reflex = Reflex(quick(), DT, FAST)
    walk(reflex, 0, 1)
    assert reflex.mark()
    walk(reflex, 2, 3, 4)
    assert rewind(reflex) == [4, 3, 2]  # at 1 control is back with the client already
    assert reflex.recovery is not None
    assert reflex.recovery.outcome == "waypoint"
    assert reflex.recovery.cause == WALL


def test_without_a_waypoint_it_goes_back_to_the_oldest_pose() -> None:
    reflex = Reflex(quick(dead_time=DT), DT, FAST)
    walk(reflex, 0, 1, 2)
    assert rewind(reflex) == [2, 1, 0]
    assert reflex.recovery is not None
    assert reflex.recovery.outcome == "end of history"


def test_poses_older_than_the_history_are_forgotten() -> None:
    reflex = Reflex(quick(history=3 * DT, dead_time=DT), DT, FAST)
    walk(reflex, 0, 1, 2, 3, 4)
    assert rewind(reflex) == [4, 3, 2]


def test_a_waypoint_reached_stays_a_waypoint() -> None:
    reflex = Reflex(quick(dead_time=DT), DT, FAST)
    walk(reflex, 0, 1)
    reflex.mark()
    walk(reflex, 2)
    assert rewind(reflex) == [2, 1]
    walk(reflex, 3, 4)
    assert rewind(reflex)[-1] == 1


def test_a_violation_shorter_than_confirm_is_noise() -> None:
    reflex = Reflex(quick(confirm=3 * DT), DT, FAST)
    for _ in range(20):
        assert reflex.tick(at(0), WALL) is None
        assert reflex.tick(at(0), WALL) is None
        assert reflex.tick(at(0), NOTHING) is None
    for _ in range(2):
        assert reflex.tick(at(0), WALL) is None
    assert reflex.tick(at(0), WALL) is not None


def test_poses_in_violation_are_not_recorded() -> None:
    reflex = Reflex(quick(confirm=2 * DT, release=2 * DT, dead_time=DT), DT, FAST)
    walk(reflex, 1)
    assert reflex.tick(at(4), WALL) is None
    walk(reflex, 2)
    assert reflex.recorded == 2
    assert reflex.tick(at(6), WALL) is None
    assert rewind(reflex) == [2, 1]


def reflexes(settings: ReflexSettings, ticks: int = 1000) -> int:
    """How often the reflex comes while the client holds the robot at a waypoint on the edge of a contact, in noise."""
    rng = np.random.default_rng(1)
    reflex = Reflex(settings, DT, FAST)
    walk(reflex, *np.linspace(0.0, 1.0, 50))
    reflex.mark()
    x = 1.0
    for _ in range(ticks):
        target = reflex.tick(at(x), WALL if x + rng.normal(0.0, 0.05) > 1.0 else NOTHING)
        x = x if target is None else float(target[0])
    return reflex.counts.reflexes


def test_at_a_waypoint_in_noise_the_naive_reflex_comes_again_and_again_and_the_filtered_one_goes_back_further() -> None:
    assert reflexes(ReflexSettings.naive()) > 300
    assert reflexes(ReflexSettings()) <= 1


def test_control_stays_cut_while_the_robot_brakes_and_rests() -> None:
    reflex = Reflex(quick(brake=3 * DT, dead_time=4 * DT), DT, FAST)
    walk(reflex, 0)
    reflex.mark()
    states = []
    while reflex.tick(at(1), WALL if not states else NOTHING) is not None:
        states.append(reflex.state)
    assert states == ["brake"] * 3 + ["dead"] * 4


def test_braking_is_rewound_from_where_it_ended() -> None:
    reflex = Reflex(quick(brake=DT, dead_time=DT), DT, np.array([10.0, 10.0]))  # 0.1 rad a tick
    walk(reflex, 0.0)
    stays = reflex.tick(at(0.2), WALL)
    first = reflex.tick(at(0.3), WALL)
    assert stays is not None
    assert first is not None
    assert stays[0] == 0.2
    assert first[0] == pytest.approx(0.2)  # 0.1 back from 0.3


def test_a_waypoint_in_violation_is_passed_by() -> None:
    reflex = Reflex(quick(dead_time=DT), DT, FAST)
    walk(reflex, 0, 1)
    reflex.mark()
    walk(reflex, 2, 3)
    reflex.mark()
    target = reflex.tick(at(4), WALL)
    went = []
    while target is not None:
        went.append(float(target[0]))
        target = reflex.tick(target, WALL if target[0] >= 3 else NOTHING)  # an object came nearer
    assert went[-1] == 1
    assert reflex.recovery is not None
    assert reflex.recovery.passed == 1


def test_without_a_history_it_is_stuck_until_the_pose_is_accepted() -> None:
    reflex = Reflex(quick(dead_time=DT), DT, FAST)
    for _ in range(5):
        assert reflex.tick(at(1), WALL) is not None
    assert reflex.state == "stuck"
    assert not reflex.mark()
    reflex.accept(at(1), WALL)
    for _ in range(5):
        assert reflex.tick(at(1), WALL) is None
    assert reflex.tick(at(1), (*WALL, *OTHER)) is not None  # only contacts that existed before are accepted


def test_an_accepted_violation_counts_again_after_it_was_absent() -> None:
    reflex = Reflex(quick(release=2 * DT, dead_time=DT), DT, FAST)
    for _ in range(5):
        reflex.tick(at(1), WALL)
    reflex.accept(at(1), WALL)
    reflex.tick(at(1), NOTHING)
    assert reflex.tick(at(1), WALL) is None  # shorter than release
    for _ in range(2):
        reflex.tick(at(1), NOTHING)
    assert reflex.tick(at(1), WALL) is not None


def test_a_stuck_robot_is_free_when_the_obstacle_goes_away() -> None:
    reflex = Reflex(quick(dead_time=DT), DT, FAST)
    for _ in range(5):
        reflex.tick(at(1), WALL)
    assert reflex.state == "stuck"
    assert reflex.tick(at(1), NOTHING) is None


def test_a_contact_that_returns_while_retracing_is_counted() -> None:
    reflex = Reflex(quick(dead_time=DT), DT, FAST)
    walk(reflex, 0)
    reflex.mark()
    walk(reflex, *range(1, 9))
    x, seen = 9.0, WALL
    while (target := reflex.tick(at(x), seen)) is not None:
        x = float(target[0])
        seen = WALL if x in (3, 5) else NOTHING
    assert reflex.recovery is not None
    assert reflex.recovery.again == 2
    assert reflex.recovery.outcome == "waypoint"


def test_a_reflex_that_is_not_obeyed_gives_up() -> None:
    reflex = Reflex(quick(brake=1.0), DT, FAST)
    walk(reflex, 0)
    reflex.tick(at(1), WALL)
    reflex.give_up()
    assert reflex.tick(at(1), WALL) is not None
    assert reflex.state == "stuck"


def test_a_pace_below_one_takes_longer() -> None:
    reflex = Reflex(quick(pace=0.5, dead_time=DT), DT, FAST)
    walk(reflex, 0, 1, 2, 3)
    assert rewind(reflex) == [6, 3, 3, 2, 2, 1, 1, 0]


@pytest.mark.parametrize(
    "wrong", [{"confirm": -1.0}, {"dead_time": np.nan}, {"pace": 0.0}, {"history": np.inf}, {"brake": "on"}, {"pace": "1"}]
)
def test_settings_that_make_no_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidValue, match=next(iter(wrong))):
        ReflexSettings(**wrong)


seen = st.lists(st.booleans(), min_size=1, max_size=300)


@given(seen, st.integers(0, 4), st.integers(0, 4), st.integers(0, 3), st.booleans())
def test_control_comes_back_at_a_clear_pose_only_and_no_target_leaps(
    raw: list[bool], confirm: int, release: int, dead: int, braked: bool
) -> None:
    settings = quick(confirm=confirm * DT, release=release * DT, dead_time=dead * DT, brake=DT * braked)
    fast = np.array([3.0, 3.0])
    reflex = Reflex(settings, DT, fast)
    x, before, run, previous = at(0.0), "forward", 0, None
    for i, violated in enumerate(raw):
        run = run + 1 if violated else 0
        target = reflex.tick(x, WALL if violated else NOTHING)
        if before == "forward" and reflex.state != "forward":
            assert run >= confirm
        if before not in ("forward", "stuck") and reflex.state == "forward":
            assert run <= confirm  # clear, or a violation that is not confirmed yet
        if target is not None and previous is not None:
            assert np.abs(target - previous).max() <= fast[0] * DT + 1e-12
        x = at(0.02 * i) if target is None else target
        previous, before = target, reflex.state
