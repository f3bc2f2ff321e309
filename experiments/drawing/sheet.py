"""Pictures in rows on one sheet, with what they show in words."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from experiments.drawing.picture import Picture
from experiments.kit.plots import new_figure

DPI = 100
GAP, MARGIN = 8, 10  # pixels
TITLE, CAPTION = 30, 22  # pixels, the height of their lines


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A picture, and the line below it."""

    picture: Picture
    caption: str = ""


def write_sheet(rows: Sequence[tuple[str, Sequence[Panel]]], path: Path, colors: int = 256) -> Path:
    """Write rows, each a title and panels from left to right, as a PNG of so many colours at most; raises MatplotlibMissing."""
    columns = [max(one.picture.shape[1] for one in column if one) for column in zip_longest(*(panels for _, panels in rows))]
    heights = [_height(title, panels) for title, panels in rows]
    width, height = sum(columns) + GAP * (len(columns) - 1) + 2 * MARGIN, sum(heights) + GAP * (len(rows) - 1) + 2 * MARGIN
    figure = new_figure(width / DPI, height / DPI)
    sheet = np.full((height, width, 3), 255, np.uint8)
    top = MARGIN
    for (title, panels), tall in zip(rows, heights, strict=True):
        left, below = MARGIN, top + (TITLE if title else 0)
        if title:
            figure.text(left / width, 1.0 - (top + 0.5 * TITLE) / height, title, fontsize=11, fontweight="bold", va="center")
        for panel, wide in zip(panels, columns, strict=False):
            (high, narrow), start = panel.picture.shape[:2], left + (wide - panel.picture.shape[1]) // 2
            sheet[below : below + high, start : start + narrow] = panel.picture
            middle = (left + 0.5 * wide) / width, 1.0 - (below + high + 0.5 * CAPTION) / height
            figure.text(*middle, panel.caption, fontsize=10, color="0.25", ha="center", va="center")
            left += wide + GAP
        top += tall + GAP
    figure.figimage(sheet, zorder=-1)
    _write(figure, path, colors)
    return path


def _height(title: str, panels: Sequence[Panel]) -> int:
    captions = CAPTION if any(panel.caption for panel in panels) else 0
    return max(panel.picture.shape[0] for panel in panels) + captions + (TITLE if title else 0)


def _write(figure: Any, path: Path, colors: int) -> None:
    """As a PNG with a palette, a third as large; rare colours, of a trail or a target, have their share in it, and white stays white."""
    from PIL import Image  # comes with Matplotlib

    written = io.BytesIO()
    figure.savefig(written, dpi=DPI, format="png")
    image = Image.open(written).convert("RGB")
    pixels = np.asarray(image)
    shades, counts = np.unique(pixels.reshape(-1, 3), axis=0, return_counts=True)
    palette = Image.fromarray(np.repeat(shades, np.ceil(np.sqrt(counts)).astype(int), axis=0)[None]).quantize(colors, kmeans=2)
    entries = np.array(palette.getpalette()).reshape(-1, 3)
    white = int(entries.sum(axis=1).argmax())
    entries[white] = 255
    palette.putpalette(entries.ravel().tolist())
    chosen = np.array(image.quantize(palette=palette, dither=Image.Dither.NONE))
    chosen[(pixels == 255).all(axis=2)] = white
    found = Image.fromarray(chosen)
    found.putpalette(entries.ravel().tolist())
    found.save(path, optimize=True)
