"""The examples by name, in the order of the thesis."""

from __future__ import annotations

from collections.abc import Callable

from experiments.trm import (
    bimanual_inspect,
    bimanual_rotate,
    bimanual_twist,
    both_held,
    elbow_down,
    inspect_hand,
    palm_down,
    palm_side,
    pregrasp,
    push_forward,
    push_over,
    raise_glass,
    reach_into,
    unscrew,
)
from experiments.trm.example import Example

EXAMPLES: dict[str, Callable[[], Example]] = {
    "both-held": both_held.example,
    "elbow-down": elbow_down.example,
    "palm-side": palm_side.example,
    "palm-down": palm_down.example,
    "raise-glass": raise_glass.example,
    "bimanual-inspect": bimanual_inspect.example,
    "inspect": inspect_hand.example,
    "push-forward": push_forward.example,
    "push-over": push_over.example,
    "reach-into": reach_into.example,
    "bimanual-rotate": bimanual_rotate.example,
    "bimanual-twist": bimanual_twist.example,
    "unscrew": unscrew.example,
    "pregrasp": pregrasp.example,
}
