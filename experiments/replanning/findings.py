"""What all crossings amount to, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from experiments.kit.claims import Claim
from experiments.replanning.measured import Measured
from experiments.replanning.scene import ABOVE, LEFT

SOON = 200.0  # ms
FEW = 10  # crossings with a bump: of fewer no verdict is made
CLAIMS = (
    Claim("thesis 4.3.2, fig. 4.7", "when the ball turns solid the hand finds the way around it, to the other side", "immediately"),
    Claim("aim of this reproduction", "the new path is under way within 200 ms of the bump, live, on robot_sim's clock", "at most 200 ms"),
    Claim("aim of this reproduction", "no solid contact with the ball deeper than 2 mm while it re-plans", "0"),
)
DEEP = 2e-3  # m


def findings(crossings: Sequence[Measured]) -> dict[str, Any]:
    """The numbers and the claims."""
    bumped = [one for one in crossings if one.bumped]
    row = {"crossings": len(crossings), "with_a_bump": len(bumped), "arrived": sum(one.arrived for one in crossings)}
    if bumped:
        for name in ("command", "turn", "thinking"):
            values = np.array([getattr(one, name) for one in bumped])
            row |= {f"{name}_ms_median": float(np.median(values)), f"{name}_ms_most": float(values.max())}
        row |= {"at_once_around": sum(one.on[1:] == [ABOVE, LEFT] for one in bumped)}
    return {"live": row, "claims": [claim.record() for claim in _claims(crossings, bumped)]}


def _claims(crossings: Sequence[Measured], bumped: Sequence[Measured]) -> list[Claim]:
    if not bumped:
        return list(CLAIMS)
    enough = len(bumped) >= FEW
    command, turn = (np.array([getattr(one, name) for one in bumped]) for name in ("command", "turn"))
    arrived = sum(one.arrived for one in bumped)
    straight = sum(one.on[1:] == [ABOVE, LEFT] for one in bumped)
    seconds = float(np.median([one.seconds for one in bumped]))
    deepest, clear = 1e3 * max(one.deepest for one in crossings), sum(one.deepest == 0.0 for one in crossings)
    return [
        CLAIMS[0].measured(
            f"{arrived} of {len(bumped)} arrive, {straight} of them straight on; {seconds:.1f} s in all",
            arrived == len(bumped) if enough else None,
        ),
        CLAIMS[1].measured(
            f"command in force after {np.median(command):.0f} ms, at most {command.max():.0f} ms; the joints come no nearer to the old goal"
            f" after {np.median(turn):.0f} ms, at most {turn.max():.0f} ms",
            bool(command.max() <= SOON) if enough else None,
        ),
        CLAIMS[2].measured(
            f"{deepest:.1f} mm; none at all in {clear} of {len(crossings)} crossings: the ball turns solid at any time, also about a hand"
            " that is in it",
            bool(deepest <= 1e3 * DEEP) if enough else None,
        ),
    ]
