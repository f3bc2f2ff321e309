"""The actions of a reach agent, with the states in which they end."""

from __future__ import annotations

from mobee.learning.space import Space
from mobee.plant import Outcome, Plant
from mobee.reach import ReachOutcome, ReachPlant


def move(plant: Plant, space: Space, state: int, action: int) -> tuple[Outcome, int]:
    """Make a transition: how it ended, and in which state."""
    outcome = plant.act(space.part, space.target(space.goal(state, action)))
    return outcome, space.state_of(outcome.q[space.columns])


def reach(plant: ReachPlant, space: Space, marker: str) -> tuple[ReachOutcome, int]:
    """Reach for what is presented: how it ended, and the state in which the part came to rest afterwards."""
    outcome = plant.reach(space.part, marker)
    return outcome, space.state_of(outcome.after.q[space.columns])
