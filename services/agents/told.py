"""How an agent tells of a transition, whether it explores or reaches."""

from __future__ import annotations

from bus_schema.messages import Transition as TransitionMessage
from mobee.learning.reaching.tries import Step
from mobee.learning.space import Space
from mobee.store import Transition
from services.common.bus import Publisher


def tell(stream: Publisher[TransitionMessage], space: Space, n: int, made: Transition | Step, value: float) -> None:
    """Put a transition, the n-th of its agent; `value`: V(s) of the plan that it was part of."""
    stream.put(
        agent=space.part,
        n=n,
        s=made.s,
        a=made.a,
        goal=int(space.goal(made.s, made.a)),
        s_next=made.s_next,
        reward=made.reward,
        value=value,
        settled=made.settled,
        duration=made.duration,
        touched=list(made.touched),
    )
