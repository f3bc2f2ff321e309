"""Error of the learnt models against transitions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.accuracy.findings import errors, looks
from experiments.accuracy.worlds import WORLDS
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue
from mobee.learning.explorers import EXPLORERS


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A column a world; above all actions, counts dashed and debiased solid; below the stochastic ones, debiased."""
    curves = errors(found)
    worlds = [world for world in WORLDS if any(key[0] == world for key in curves)]
    if not worlds:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(4.6 * len(worlds), 6.4)
    for (above, below), world in zip(drawing.subplots(2, len(worlds), squeeze=False, sharex="col").T, worlds, strict=True):
        for number, explorer in enumerate(EXPLORERS):
            if (world, explorer) in curves:
                counts, _, debiased, stochastic = np.median(curves[world, explorer], axis=0).T
                label = explorer.replace("_", " ")
                above.plot(looks(world), counts, "--", color=f"C{number}", linewidth=0.9)
                above.plot(looks(world), debiased, color=f"C{number}", label=label)
                below.plot(looks(world), stochastic, color=f"C{number}", label=label)
        above.set(title=WORLDS[world].text, ylabel="L1, all actions", yscale="log")
        above.title.set_fontsize(9)
        below.set(xlabel="transitions", ylabel="L1, stochastic actions", ylim=(0.0, None))
        if not any(np.isfinite(curves[key][:, :, 3]).any() for key in curves if key[0] == world):
            below.text(0.5, 0.5, "there is none", transform=below.transAxes, ha="center")
        above.grid(alpha=0.2)
        below.grid(alpha=0.2)
    drawing.axes[0].legend(fontsize=7, title="debiased; dashed: with imagined counts", title_fontsize=7)
    drawing.savefig(path, dpi=150)
    return path
