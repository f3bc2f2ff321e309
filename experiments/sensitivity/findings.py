"""Which variants carry the published findings, and which lose them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.claims.ch7_learning.rank4 import ASIDE, HARDLY, NEVER
from experiments.kit.arm_learning import RANK3, RANK4, arm_space
from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.outcomes import ends_of, outcome_counts, visits_of
from experiments.sensitivity.variants import PUBLISHED, VARIANTS
from mobee.robot.robot import Ints

LEVELS = {"rank4": RANK4, "rank3": RANK3}
ACTIONS = {"rank4": 5_000, "rank3": 3_000}
FAILING, ENTERING = ((15, 24), (42, 51), (69, 78)), (21, 24)
RARE = 4.0  # visits of each of the hardly reached states in 5000 actions: 10 in 14 597
MOST, SOME = 0.9, 0.5

AIM = "aim of this reproduction"
CARRIED = Claim(AIM, "the published numbers carry the findings of rank 4 (5000 actions) and rank 3 (3000)", "both")
ROBUST = Claim(AIM, "the findings hang on no number of the motors: delay, lag, backlash, noise from 0.05 to 0.2 deg", "no change loses one")
MOMENTUM = Claim(
    "thesis 7.2.5", "whether the hard states are entered is decided by what motion is left when the action is called settled", "suspected"
)
NOISE = Claim(
    "thesis 7.2.5",
    "outcomes are uncertain for noise in the sensory-motor apparatus: actions with several outcomes",
    "suspected",
)
CLAIMS = (CARRIED, ROBUST, MOMENTUM, NOISE)

_MOTORS = ("encoder noise, deg (0.1): 0.05", "encoder noise, deg (0.1): 0.2", "motor delay", "motor lag", "backlash")


@dataclass(frozen=True)
class Row:
    """A variant, mean over its runs."""

    never: float  # of the four states, how many were never reached
    hardly: float  # visits of each of the other four
    others: float  # states never reached beside these eight
    aside: float  # share of the three actions turned aside that ended one pitch level up
    where: str  # where 57->61 ended most often
    failing: float  # share of failures of the rank 3 entries that fail as published
    entering: float  # of 21->24
    uncertain: float  # actions of rank 4 that ended in more than one state
    timeouts: float
    seconds: float  # an action, of the plant's time

    @property
    def rank4(self) -> bool:
        """Whether the findings of rank 4 are there."""
        return self.never == len(NEVER) and self.hardly <= RARE and self.others == 0 and self.aside >= MOST

    @property
    def rank3(self) -> bool:
        """Whether those of rank 3 are."""
        return self.failing >= SOME and self.entering <= 1.0 - MOST

    def record(self) -> dict[str, Any]:
        """As a row of the results."""
        return {
            "rank4": "carried" if self.rank4 else "lost",
            "rank3": "carried" if self.rank3 else "lost",
            **{name: _known(getattr(self, name)) for name in self.__dataclass_fields__},
        }


def _known(value: Any) -> Any:
    """None for NaN, which JSON has not."""
    return None if value != value else value


def rows_of(found: Mapping[str, CellResult]) -> dict[str, Row]:
    """Of every variant with a finished run, in the order of the variants."""
    cells: dict[str, list[dict[str, Any]]] = {}
    for result in found.values():
        cells.setdefault(result.cell.settings["variant"], []).append(result.values)
    return {variant: _row(cells[variant]) for variant in VARIANTS if variant in cells}


def _row(runs: Sequence[Mapping[str, Any]]) -> Row:
    spaces = {name: arm_space(levels) for name, levels in LEVELS.items()}
    four, three = ([run[name].astype(np.intp) for run in runs] for name in ("rank4", "rank3"))
    visits = np.array([visits_of(spaces["rank4"], seen) for seen in four])
    eight = (*NEVER, *HARDLY)
    where: Counter[int] = Counter()
    for seen in four:
        where.update(ends_of(spaces["rank4"], seen, 57, 61))
    return Row(
        never=float((visits[:, NEVER] == 0).sum(axis=1).mean()),
        hardly=float(visits[:, HARDLY].mean()),
        others=float((np.delete(visits, eight, axis=1) == 0).sum(axis=1).mean()),
        aside=_share(spaces["rank4"], four, {pair: {end} for pair, end in ASIDE.items()}),
        where=" ".join(str(state) for state, _ in where.most_common(1)),
        failing=1.0 - _share(spaces["rank3"], three, {pair: {pair[1]} for pair in FAILING}),
        entering=1.0 - _share(spaces["rank3"], three, {ENTERING: {ENTERING[1]}}),
        uncertain=float(np.mean([(outcome_counts(spaces["rank4"], seen) > 1).sum() for seen in four])),
        timeouts=float(np.mean([run["timeouts"] for run in runs])),
        seconds=float(np.mean([run["seconds"] for run in runs])),
    )


def _share(space: Any, runs: Sequence[Ints], ends: Mapping[tuple[int, int], set[int]]) -> float:
    """Which share of the tries of these actions (source, goal) ended in one of these states; NaN without a try."""
    hits = tries = 0
    for seen in runs:
        for (source, goal), wanted in ends.items():
            found = ends_of(space, seen, source, goal)
            tries += sum(found.values())
            hits += sum(count for state, count in found.items() if state in wanted)
    return hits / tries if tries else float("nan")


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a variant; the claims if all were run."""
    rows = rows_of(found)
    whole = set(rows) == set(VARIANTS) and all(len(result.values["rank4"]) == ACTIONS["rank4"] for result in found.values())
    return {
        "variants": {variant: row.record() for variant, row in rows.items()},
        "claims": [claim.record() for claim in (_claims(rows) if whole else CLAIMS)],
    }


def _claims(rows: Mapping[str, Row]) -> list[Claim]:
    base = rows[PUBLISHED]
    motors = {variant: row for variant, row in rows.items() if variant.startswith(_MOTORS)}
    lost = [variant for variant, row in motors.items() if not (row.rank4 and row.rank3)]
    speeds = {variant.rpartition(" ")[2]: row for variant, row in rows.items() if variant.startswith("settle speed")}
    changed = [speed for speed, row in speeds.items() if not (row.rank4 and row.rank3)]
    text = ", ".join(f"{speed} deg/s: 57->61 ends in {row.where}, rank 3 entries fail {row.failing:.2f}" for speed, row in speeds.items())
    carry = f"{len(motors) - len(lost)} of {len(motors)} changes carry both" + (f"; lost with {', '.join(lost)}" if lost else "")
    both = " and ".join(name for name, carried in (("rank 4", base.rank4), ("rank 3", base.rank3)) if carried)
    return [
        CARRIED.measured(both or "neither", base.rank4 and base.rank3),
        ROBUST.measured(carry, not lost),
        MOMENTUM.measured(text, bool(changed)),
        _noise(rows),
    ]


def _noise(rows: Mapping[str, Row]) -> Claim:
    levels = {"0.1": rows[PUBLISHED]} | {v.rpartition(" ")[2]: row for v, row in rows.items() if v.startswith("encoder noise")}
    counts = {level: levels[level].uncertain for level in sorted(levels, key=float)}
    text = ", ".join(f"{count:.0f} at {level} deg" for level, count in counts.items())
    return NOISE.measured(text, counts["0"] < 0.5 * counts["0.1"] < 0.5 * counts["0.4"])
