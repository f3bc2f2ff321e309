"""Figure 2.4: our curves beside what the thesis says in numbers; and what an endurance run looks like over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from experiments.flood.rates import binned
from experiments.flood.records import Record
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue

COLORS = {"katana": "tab:orange", "icub": "tab:blue"}
LABELS = {"katana": "Katana", "icub": "iCub"}
BIN = 1.0  # s of flood a point of a curve
HUNDREDS = (100.0, 1000.0)
STATE_RATE = 100.0  # Hz, at which the iCub's motors report (thesis 2.3.2)


def draw(records: Sequence[Record], path: Path) -> Path:
    """Evaluations a second against the number of objects; raises InvalidValue if there is nothing to draw."""
    if not records:
        raise InvalidValue(f"{path.parent} has no records of a flood: it was stopped before the first.")
    drawing = new_figure(8.0, 5.0)
    axes = drawing.add_subplot()
    most = max(max(record["objects"] for record in records), 1)
    if most > HUNDREDS[0]:
        claim = 'thesis: iCub, "hundreds of poses per second\n… with hundreds of obstacles"'
        axes.fill_between((HUNDREDS[0], min(most, HUNDREDS[1])), *HUNDREDS, color="0.85", zorder=0, label=claim)
    axes.axhline(STATE_RATE, color="0.5", linestyle=":", label="thesis: the iCub reports its state at 100 Hz")
    for robot, color in COLORS.items():
        mine = [record for record in records if record["robot"] == robot]
        if not mine:
            continue
        flooded = list(binned([record for record in mine if record["edits"]], BIN))
        still = list(binned([record for record in mine if not record["edits"]], 0.0))
        said = "flooded" if flooded else "flooded: too short for a rate"
        axes.plot(*_columns(flooded), "-s" if len(flooded) == 1 else "-", color=color, label=f"{LABELS[robot]}, {said}")
        axes.plot(*_columns(still), "--o", color=color, markersize=3.0, linewidth=0.8, label=f"{LABELS[robot]}, no edits")
    axes.set(xlabel="objects in the workspace", ylabel="evaluations per second", yscale="log", xlim=(0.0, 1.03 * most))
    axes.set_title("Thesis figure 2.4: model evaluations while the world is flooded with edits")
    axes.grid(which="both", alpha=0.2)
    axes.legend(fontsize=8)
    drawing.savefig(path, dpi=150)
    return path


def draw_endurance(records: Sequence[Mapping[str, str]], path: Path) -> Path:
    """Resident memory, and the edits and evaluations so far, over time."""
    drawing = new_figure(8.0, 5.0)
    above, below = drawing.subplots(2, 1, sharex=True)
    minutes = [float(record["seconds"]) / 60.0 for record in records]
    above.plot(minutes, [float(record["resident_mb"] or "nan") for record in records])
    above.set(ylabel="resident memory [MB]", title="Several threads edit the world while the model evaluates")
    above.set_ylim(0.0, 1.2 * above.get_ylim()[1])
    for column in ("edits", "evaluations"):
        below.plot(minutes, [int(record[column]) for record in records], label=column)
    below.set(xlabel="time [min]", ylabel="so far", yscale="log")
    below.legend()
    drawing.savefig(path, dpi=150)
    return path


def _columns(points: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [x for x, _ in points], [y for _, y in points]
