# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from bus_schema import VERSION
from bus_schema.messages import Command, Mode
from services.port_filter.passage import MoveDetector

TICK = 10_000_000  # ns


def begins(moves: MoveDetector, positions: list[float], mode: Mode = "position", start: int = 0) -> list[int]:
    """The ticks at which a move begins; one command a tick."""
    found = []
    for k, position in enumerate(positions, start):
        header = {"v": VERSION, "run": "r", "src": "client", "seq": k, "k": k, "t": k * TICK, "tw": 0}
        if moves.begins(Command(**header, epoch=1, re_k=k, mode=mode, ref=[position, 0.0], ttl=100), k * TICK):
            found.append(k)
    return found


def test_the_first_position_begins_a_move() -> None:
    assert begins(MoveDetector(), [1.0, 2.0, 3.0]) == [0]


def test_a_move_begins_where_the_reference_leaves_a_rest() -> None:
    assert begins(MoveDetector(), [1.0] * 20 + [2.0, 3.0] + [4.0] * 20 + [3.0]) == [0, 20, 42]


def test_a_position_that_is_sent_once_rests_too() -> None:
    moves = MoveDetector()
    assert [begins(moves, [position], start=k) for k, position in ((0, 1.0), (9, 2.0), (50, 3.0))] == [[0], [], [50]]


def test_a_reference_that_pauses_briefly_is_one_motion() -> None:
    assert begins(MoveDetector(), [1.0, 2.0, 2.0, 2.0, 3.0]) == [0]


def test_other_modalities_begin_no_move_and_end_one() -> None:
    moves = MoveDetector()
    assert begins(moves, [1.0, 2.0]) == [0]
    assert begins(moves, [1.0, 2.0], "velocity", 2) == []
    assert begins(moves, [3.0, 4.0], start=4) == [4]


def test_after_the_reflex_the_next_position_begins_a_move() -> None:
    moves = MoveDetector()
    begins(moves, [1.0, 2.0])
    moves.forget()
    assert begins(moves, [3.0], start=2) == [2]
