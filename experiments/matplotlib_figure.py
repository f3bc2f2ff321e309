"""Matplotlib, if it is there: experiments run without it, only their figures need it."""

from __future__ import annotations

from typing import Any

from mobee.errors import MobeeError


class MatplotlibMissing(MobeeError):
    """Raised when a figure is asked for and Matplotlib is not installed."""


def new_figure(width: float, height: float) -> Any:
    """An empty matplotlib.figure.Figure, inches; raises MatplotlibMissing."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MatplotlibMissing("figures need Matplotlib, which is not installed: pip install '.[figures]' in MoBeE's folder") from None
    return Figure(figsize=(width, height), layout="constrained")
