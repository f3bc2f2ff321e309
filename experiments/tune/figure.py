"""How the search went."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.kit.plots import new_figure
from experiments.tune.criteria import WANTED
from experiments.tune.search import TUNED, Tried
from mobee.errors import InvalidValue


def draw(tried: Sequence[Tried], path: Path) -> Path:
    """The objective with its parts, and the gains of the best so far; raises InvalidValue if there is nothing to draw."""
    if not tried:
        raise InvalidValue(f"{path.parent} has no gains in it: it was stopped before the first were judged.")
    drawing = new_figure(12.0, 4.5)
    course, numbers = drawing.subplots(1, 2)
    objectives = [one.objective for one in tried]
    best = [min(range(i + 1), key=objectives.__getitem__) for i in range(len(tried))]
    places = range(1, len(tried) + 1)
    course.plot(places, objectives, ".", color="0.7", label="objective of every set")
    parts = {"settling time [s]": [tried[i].judged.settling_s for i in best]}
    for name, (wanted, price) in WANTED.items():
        costs = [price * max(0.0, getattr(tried[i].judged, name) - wanted) for i in best]
        if any(costs):
            parts[f"{name} beyond {wanted:g}"] = costs
    course.stackplot(places, *parts.values(), labels=parts, alpha=0.8)
    course.set(
        xlabel="gain sets judged", ylabel="objective", title="Best so far: what its objective is made of", ylim=(0.0, 1.1 * objectives[0])
    )
    course.legend(fontsize=6)
    for name in TUNED:
        numbers.plot(places, [tried[i].numbers[name] / tried[0].numbers[name] for i in best], label=name)
    numbers.set(xlabel="gain sets judged", ylabel="best so far, over Gains.default()", yscale="log", title="The gains")
    numbers.set_yticks(ticks := np.array([0.25, 0.5, 1.0, 2.0, 4.0]), [f"{tick:g}" for tick in ticks])
    numbers.minorticks_off()
    numbers.legend(fontsize=6)
    for axes in (course, numbers):
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.grid(alpha=0.2)
    drawing.savefig(path, dpi=130)
    return path
