# SPDX-License-Identifier: Apache-2.0
"""Precedence: which service may take the goal of a part (the right to set its attractor) while another service owns it.

The rule is in this file alone. A service of higher rank may take the part from its owner at any time. The behaviours (`assist`, `gaze`)
have the lowest ranks; a behaviour takes its part again when the part is free. All other services, such as agents, clients and commands,
have the same, highest rank: the first one keeps the part until it releases it or ends.
"""

from __future__ import annotations

from bus_schema.authority import BEHAVIOURS


def rank_of(who: str) -> int:
    """Return the rank of the service named `who`; a service may take a part from an owner of lower rank.

    The rank of a behaviour is its index in BEHAVIOURS: "assist" 0, "gaze" 1. The rank of every other service is 2, the highest.
    """
    return BEHAVIOURS.index(who) if who in BEHAVIOURS else len(BEHAVIOURS)


def may_take_from(who: str, owner: str) -> bool:
    """Return whether the service `who` may take the goal of a part from its owner: only if its rank is higher."""
    return rank_of(who) > rank_of(owner)
