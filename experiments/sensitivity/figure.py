"""The table of variants as a picture: what is as published in green, what is lost in red."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from experiments.claims.ch7_learning.rank4 import NEVER
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.sensitivity.findings import MOST, RARE, SOME, Row, rows_of
from mobee.errors import InvalidValue

GOOD, BAD, PLAIN = "#d5f0d5", "#f6cccc", "white"
HEADER = (
    "",
    "60 124 188 252\nunreached",
    "visits of 61\n125 189 253",
    "other states\nunreached",
    "57->61 and like:\none level up",
    "57->61\nends in",
    "rank 3 entries\nfail",
    "21->24\nfails",
    "actions with\n2+ outcomes",
    "timeouts",
    "s an\naction",
)


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A row a variant.  Raises InvalidValue if there is nothing to draw."""
    rows = rows_of(found)
    if not rows:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(13.0, 0.8 + 0.23 * len(rows))
    axes = drawing.subplots()
    axes.axis("off")
    body = [_row(variant, row) for variant, row in rows.items()]
    table = axes.table(
        cellText=[HEADER, *([text for text, _ in row] for row in body)],
        cellColours=[[PLAIN] * len(HEADER), *([color for _, color in row] for row in body)],
        colWidths=[0.3, *[0.078] * (len(HEADER) - 1)],
        cellLoc="center",
        loc="center",
        bbox=(0.0, 0.0, 1.0, 1.0),
    )
    table.auto_set_font_size(False)
    table.set_fontsize(7)
    for row in range(1, len(body) + 1):
        table[row, 0].set_text_props(ha="left")
    for column in range(len(HEADER)):
        table[0, column].set_height(2.2 * table[1, column].get_height())
    drawing.savefig(path, dpi=150)
    return path


def _row(variant: str, row: Row) -> list[tuple[str, str]]:
    """Texts and colours."""
    return [
        (variant, GOOD if row.rank4 and row.rank3 else BAD),
        (f"{row.never:.1f} of {len(NEVER)}", _color(row.never == len(NEVER))),
        (f"{row.hardly:.1f}", _color(row.hardly <= RARE)),
        (f"{row.others:.1f}", _color(row.others == 0)),
        (f"{row.aside:.2f}", _color(row.aside >= MOST)),
        (row.where, _color(row.where == "62")),
        (f"{row.failing:.2f}", _color(row.failing >= SOME)),
        (f"{row.entering:.2f}", _color(row.entering <= 1.0 - MOST)),
        (f"{row.uncertain:.0f}", PLAIN),
        (f"{100.0 * row.timeouts:.1f} %", PLAIN),
        (f"{row.seconds:.1f}", PLAIN),
    ]


def _color(is_as_published: bool) -> str:
    return GOOD if is_as_published else BAD
