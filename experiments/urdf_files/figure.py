"""The files drawn: how far their links' frames are from Pinocchio's, and what touches at home."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.kit.plots import new_figure
from experiments.urdf_files.looked_at import LookedAt

ALLOWED = 1e-9


def draw(found: Sequence[LookedAt], path: Path) -> Path:
    """Two panels, files sorted in each."""
    loaded = [one for one in found if one.outcome == "loads"]
    figure = new_figure(9.0, 3.5)
    left, right = figure.subplots(1, 2)
    errors = np.sort([one.frame_error for one in loaded if not np.isnan(one.frame_error)])
    left.semilogy(np.maximum(errors, 1e-17), ".", color="C0")
    left.axhline(ALLOWED, color="0.5", linestyle="--", label="allowed")
    left.set(xlabel="files", ylabel="frames off Pinocchio's, at most")
    left.legend()
    for label, counts in (("without an SRDF", [one.at_home_without for one in loaded]), ("as loaded", [one.at_home for one in loaded])):
        right.plot(-np.sort(-np.array(counts, dtype=int)), ".-", label=label)
    right.set(xlabel="files", ylabel="solid contacts at home", yscale="symlog")
    right.legend()
    figure.savefig(path, dpi=150)
    return path
