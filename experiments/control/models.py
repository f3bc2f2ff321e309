"""The models that the experiments about the control law move in."""

from __future__ import annotations

from functools import lru_cache

from mobee import Model, load_robot, load_world


@lru_cache(maxsize=1)
def icub() -> Model:
    """The iCub alone."""
    return Model(load_robot("icub"))


@lru_cache(maxsize=1)
def icub_at_table() -> Model:
    """The iCub and the table in front of it."""
    return Model(load_robot("icub"), load_world("table"))
