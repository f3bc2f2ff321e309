"""What all blocks amount to, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from experiments.kit.claims import Claim
from experiments.live_reach.measured import Block, Judged
from experiments.live_reach.problems import FRESH, GRID, OBSTACLE_MOVES, TARGET_MOVES

WHO, MOVING = ("learner", "peer"), "moving"
TOLD = {"learner": "learned reacher", "peer": "IK + RRT-Connect through MoBeE"}
LEAST = {GRID: 0.95, FRESH: 0.9}
SOON = 5e-3  # s
FEW = 20  # tries: of fewer no verdict is made
CLAIMS = (
    Claim(
        "aim of this reproduction",
        "live, refined live: palm within 2 cm of the surface of those of the 27 targets that can be reached, from random poses",
        "at least 0.95",
    ),
    Claim("aim of this reproduction", "live: palm within 2 cm of the surface of fresh random targets, from random poses", "at least 0.90"),
    Claim("aim of this reproduction", "no listed solid contact of PyBullet deeper than 2 mm while it reaches for what rests", "0"),
    Claim("aim of this reproduction", "a reach moves within 5 ms of the request, on robot_sim's clock", "at most 5 ms"),
    Claim("aim of this reproduction", "live, the learned reacher is no worse than inverse kinematics and RRT-Connect", "-"),
)


def tries_of(blocks: Sequence[Block], who: str, kind: str, numbers: frozenset[int] | None = None) -> list[Judged]:
    """All tries of a contestant on one set of targets, or on those numbers of it."""
    found = [tried for block in blocks if block.kind == who for tried in block.tries if tried.kind == kind]
    return [tried for tried in found if numbers is None or tried.number in numbers]


def share(tries: Sequence[Judged]) -> str:
    """Successes of tries, and the 95 % interval of their share (Wilson)."""
    made = sum(tried.success for tried in tries)
    if not tries:
        return "none"
    low, high = binomtest(made, len(tries)).proportion_ci(method="wilson")
    return f"{made} of {len(tries)}, {made / len(tries):.2f} [{low:.2f}, {high:.2f}]"


def enough(tries: Sequence[Judged], least: float) -> bool | None:
    """Whether their share of successes is as large as that; None: less, but by chance perhaps."""
    if len(tries) < FEW:
        return None
    made = sum(tried.success for tried in tries)
    if made >= least * len(tries):
        return True
    return False if binomtest(made, len(tries)).proportion_ci(method="wilson").high < least else None


def claims(blocks: Sequence[Block], touchable: frozenset[int], left: frozenset[int]) -> list[Claim]:
    """The claims with our numbers; `touchable`: those of the 27, `left`: those of them that MoBeE's fields let a palm come to."""
    grid, fresh = tries_of(blocks, "learner", GRID, touchable), tries_of(blocks, "learner", FRESH)
    deep = [touch for block in blocks if block.kind in ("refine", "learner") for touch in block.deep]
    hours = sum(block.seconds for block in blocks if block.kind in ("refine", "learner")) / 3600.0
    first = [1e3 * tried.first / block.rate for block in blocks if block.kind == "first motion" for tried in block.tries if tried.first > 0]
    ticks = sorted({1e3 / block.rate for block in blocks if block.kind == "first motion"})
    rivals = {who: tries_of(blocks, who, GRID, touchable) + tries_of(blocks, who, FRESH) for who in WHO}
    worst = f"deepest {1e3 * max(touch.depth for touch in deep):.1f} mm ({max(deep, key=lambda t: t.depth).pair}), " if deep else ""
    apart = (
        f"of the {len(left)} that the robot's own fields let a palm come to {share(tries_of(blocks, 'learner', GRID, left))}; "
        f"of all 27 {share(tries_of(blocks, 'learner', GRID))}"
    )
    return [
        CLAIMS[0].measured(f"{share(grid)} of {len(touchable)}; {apart}", enough(grid, LEAST[GRID])),
        CLAIMS[1].measured(share(fresh), enough(fresh, LEAST[FRESH])),
        CLAIMS[2].measured(f"{len(deep)}, {worst}in {hours:.1f} h of robot time", not deep if len(grid) + len(fresh) >= FEW else None),
        CLAIMS[3].measured(
            f"{max(first):g} ms at most to the first command that moves ({len(first)} reaches, ticks of {ticks[0]:g} ms)"
            if first
            else "none",
            max(first) <= 1e3 * SOON if first else None,
        ),
        CLAIMS[4].measured("; ".join(f"{TOLD[who]} {share(made)}" for who, made in rivals.items()), _no_worse(rivals)),
    ]


def _no_worse(rivals: Mapping[str, Sequence[Judged]]) -> bool | None:
    """By the tries, which are the same for both."""
    learner, peer = (np.array([tried.success for tried in rivals[who]]) for who in WHO)
    if len(learner) < FEW or len(learner) != len(peer):
        return None
    return bool(learner.mean() >= peer.mean()) or None


def table(blocks: Sequence[Block], touchable: frozenset[int]) -> list[dict[str, Any]]:
    """A row a contestant and set of targets."""
    sets = {
        f"{len(touchable)} of the 27": (GRID, touchable),
        f"the {27 - len(touchable)} others": (GRID, frozenset(range(27)) - touchable),
        "fresh": (FRESH, None),
    }
    sets |= {TARGET_MOVES: (TARGET_MOVES, None), OBSTACLE_MOVES: (OBSTACLE_MOVES, None)}
    rows = []
    for who in (*WHO, MOVING):
        for name, (kind, numbers) in sets.items():
            tries = tries_of(blocks, who, kind, numbers)
            if tries:
                rows.append({"who": TOLD.get(who, TOLD["learner"]), "targets": name, "success": share(tries), **_spent(tries)})
    return rows


def _spent(tries: Sequence[Judged]) -> dict[str, Any]:
    ended = [tried for tried in tries if not tried.why]
    return {
        "off, median [mm]": round(1e3 * float(np.median([min(tried.off, 9.0) for tried in tries])), 1),
        "robot time, median [s]": round(float(np.median([tried.seconds for tried in ended])), 1) if ended else None,
        "actions": round(float(np.mean([tried.actions for tried in ended])), 1) if ended else None,
        "planning, mean [ms]": round(1e3 * float(np.mean([tried.thinking for tried in ended])), 1) if ended else None,
        "solid contacts > 2 mm": sum(len(tried.deep) for tried in tries),
    }


def misses(blocks: Sequence[Block], touchable: frozenset[int], why: Callable[[tuple[float, float, float]], str]) -> list[dict[str, Any]]:
    """Which targets that can be touched were missed, by whom and by how much; `why` says it of those that the learner missed."""
    return [
        {
            "who": block.kind,
            "target": f"{tried.kind} {tried.number} at {tuple(round(x, 2) for x in tried.position)}",
            "off [mm]": None if np.isinf(tried.off) else round(1e3 * tried.off),
            "reaches": tried.reaches,
            "why": tried.why or (why((tried.position[0], tried.position[1], tried.position[2])) if block.kind == WHO[0] else ""),
        }
        for block in blocks
        if block.kind in WHO
        for tried in block.tries
        if not tried.success and (tried.kind == FRESH or tried.number in touchable)
    ]
