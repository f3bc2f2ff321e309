# SPDX-License-Identifier: Apache-2.0
"""Precedence: from whom the goal of a part may be taken while it has an owner.

The rule is in this file alone. A behaviour moves only parts that no agent, client or command uses: each of these may take the part from the
behaviour at any time, and so may a behaviour of a higher rank. The behaviour takes the part again when the part is free. Agents, clients
and commands are of equal rank: the first one keeps the part until it releases it or ends.
"""

from __future__ import annotations

from bus_schema.authority import BEHAVIOURS


def rank_of(who: str) -> int:
    """Return the rank of the service named `who`: for a behaviour its index in BEHAVIOURS ("assist", "gaze"), for every other service 2."""
    return BEHAVIOURS.index(who) if who in BEHAVIOURS else len(BEHAVIOURS)


def may_take_from(who: str, owner: str) -> bool:
    """Return whether the service `who` may take the goal of a part from its owner: only if its rank is higher."""
    return rank_of(who) > rank_of(owner)
