# SPDX-License-Identifier: Apache-2.0
"""The claims follow from blocks of tries."""

from __future__ import annotations

from experiments.claims.ch8_reaching.live_reach.claim import CLAIMS, NAMES, Runs, enough, misses, plot, share, table
from experiments.claims.ch8_reaching.live_reach.problems import FRESH, GRID
from experiments.claims.ch8_reaching.live_reach.tries import Block, Judged
from experiments.kit.experiment import judged
from experiments.kit.live.system import Touch

KNOWN, LEFT = frozenset(range(20)), frozenset(range(1, 20))


def measured(blocks):
    return judged(CLAIMS, Runs(blocks, KNOWN, LEFT))


def a_try(kind: str, number: int, off: float, first: int = -1) -> Judged:
    return Judged(kind, number, [-0.2, 0.2, 0.1], off, off <= 0.02, 5.0, 3, 1, 0.01, [], 0.0, "", first, first + 10)


def block(who: str, tries: list[Judged], deep: list[Touch] | None = None, rate: float = 50.0) -> Block:
    return Block(who, rate, 3600.0, True, tries, deep or [])


def both(missed: int) -> list[Block]:
    """A learner that misses `missed` of the 20 targets that can be reached and 5 times as many of 50 new ones; the peer misses all."""
    tries = [a_try(GRID, number, 0.05 if number < missed or number >= 20 else 0.0) for number in range(27)]
    tries += [a_try(FRESH, number, 0.05 if number < 5 * missed else 0.0) for number in range(50)]
    return [block("learner", tries), block("offline", tries), block("peer", [a_try(one.kind, one.number, 0.1) for one in tries])]


def verdicts(blocks: list[Block]) -> list[str]:
    return [claim["verdict"] for claim in measured(blocks)]


def test_success_is_judged_for_the_targets_that_can_be_reached() -> None:
    assert verdicts(both(1)) == ["open", "open", "met", "open", "met", "met"]  # 19 of 20 are not yet 0.95
    assert verdicts(both(8))[:2] == ["not met", "not met"]
    assert all(text in measured(both(1))[0]["ours"] for text in ("19 of 20", "for the 19 from", "19 of 19", "for all 27 19 of 27"))


def test_live_tries_that_fail_more_often_than_offline_are_not_equivalent() -> None:
    blocks = both(8)
    offline = block("offline", both(0)[0].tries)
    assert measured([blocks[0], offline])[5]["verdict"] == "not met"
    assert measured([blocks[0]])[5]["verdict"] == "open"


def test_a_share_that_is_too_small_perhaps_by_chance_is_open() -> None:
    tries = [a_try(FRESH, number, 0.05 if number < 3 else 0.0) for number in range(20)]
    assert enough(tries, 0.9) is None and enough(tries, 0.8) is None and enough(tries, 0.6) is True and enough([], 0.9) is None
    assert share(tries).startswith("17 of 20, 0.85 [")


def test_a_deep_contact_of_the_learner_refutes_and_one_of_the_peer_does_not() -> None:
    touch = Touch("r_hand table", 1, 2, 0.004)
    assert measured([*both(1), block("refine", [], [touch])])[2]["verdict"] == "not met"
    assert measured([*both(1), block("peer", [], [touch])])[2]["verdict"] == "met"


def test_the_slowest_reach_decides_the_time_to_the_first_motion() -> None:
    quick, slow = (block("first motion", [a_try(FRESH, 0, 0.0, 2), a_try(FRESH, 1, 0.0, ticks)], rate=500.0) for ticks in (2, 3))
    assert measured([*both(1), quick])[3]["verdict"] == "met"
    assert measured([*both(1), slow])[3]["verdict"] == "not met"


def test_blocks_give_tables_and_a_figure(tmp_path) -> None:
    blocks = both(2)
    assert [row["targets"] for row in table(blocks, KNOWN)] == 3 * [
        "20 of the 27 that can be reached",
        "the 7 others",
        "new random targets",
    ]
    missed = misses(blocks, KNOWN, lambda place: "too far")
    assert [row["why"] for row in missed if row["contestant"] == NAMES["learner"]] == 12 * ["too far"]
    plot(blocks, KNOWN).savefig(tmp_path / "live.png")
