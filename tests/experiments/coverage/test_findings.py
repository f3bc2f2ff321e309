from __future__ import annotations

import numpy as np

from experiments.coverage.findings import _claims, _row, first_repeat, states_seen


def values(end: float, floor: int = 100, repeats_at: int = 50):
    new = np.concatenate([np.arange(1, repeats_at), [end]]).astype(int)
    return {
        "new_actions": new,
        "new_states": np.arange(81) * 2,
        "state_actions": len(new),
        "floor": floor,
        "failed": 0.0,
        "transitions": end,
    }


def published(curious: int, least: int):
    runs = {"curious": (curious, 900), "least_tried": (least, 400), "random": (9 * curious, 30)}
    return {
        (world, name): [values(end + seed, floor=1550, repeats_at=repeat) for seed in range(10)]
        for world in ("constrained", "free")
        for name, (end, repeat) in runs.items()
    }


def verdicts(claims) -> dict[str, str]:
    return {claim.text[:20]: claim.verdict for claim in claims}


def test_the_first_repeat_and_the_states_seen_are_read_from_what_was_new():
    one = values(99.0, repeats_at=50)
    assert first_repeat(one) == 50 and states_seen(one, 20) == 11


def test_what_was_never_covered_is_counted():
    one = values(99.0)
    row = _row([one, one | {"transitions": 5000, "state_actions": 51}])
    assert row["unfinished"] == 1 and row["high"] == 5000


def test_half_the_time_close_to_the_floor_confirms_the_claims():
    found = verdicts(_claims(published(1590, 3200)))
    assert found["AC has tried every ac"[:20]] == "confirmed"
    assert found["AC produces, by far,"[:20]] == "confirmed"
    assert found["early on AC and LT t"[:20]] == "confirmed"
    assert found["AC needs at most 1.0"[:20]] == "confirmed"


def test_depletion_is_judged_in_both_worlds_or_not_at_all():
    runs = published(1590, 3200)
    runs |= {(world, name): runs[world, "curious"] for world in ("constrained", "free") for name in ("depleting", "nearest_untried")}
    assert verdicts(_claims(runs))["curiosity that deple"] == "confirmed"
    del runs["free", "nearest_untried"]
    assert verdicts(_claims(runs))["curiosity that deple"] == "open"


def test_other_numbers_refute_them():
    found = verdicts(_claims(published(3000, 3200)))
    assert found["AC has tried every ac"[:20]] == "refuted"
    assert found["AC needs at most 1.0"[:20]] == "refuted"


def test_equal_early_novelty_refutes_that_one_is_more_aggressive():
    assert verdicts(_claims(published(1590, 3200)))["before 220 transitio"[:20]] == "refuted"
