# SPDX-License-Identifier: Apache-2.0
"""The colours, fonts and marks of a film. They match those of the monitor's web page (web/files/page.css)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mobee.errors import NotInstalled
from mobee.rendering.palette import Color

GROUND, PANEL, LINE = (15, 19, 24), (22, 28, 35), (38, 47, 58)
TEXT, QUIET = (233, 237, 242), (152, 165, 179)
MISSED, REACHED, WHITE = (255, 202, 97), (102, 205, 130), (255, 255, 255)
LEARNED = (34, 43, 54)  # colour of a place where nothing is left to learn
OTHERS = (124, 138, 153)  # colour of the curve of random exploration


@dataclass(frozen=True)
class Fonts:
    """The Pillow fonts of a film.

    `title`: for titles. `strong`: for the action that an agent tries. `text`: for other text. `small`: for remarks.
    """

    title: Any
    strong: Any
    text: Any
    small: Any


def fonts() -> Fonts:
    """Return the fonts of a film, loaded from the font files of Matplotlib. Raises NotInstalled if Matplotlib or Pillow is missing."""
    try:
        from matplotlib import get_data_path
        from PIL import ImageFont
    except ImportError:
        raise NotInstalled('a film needs Matplotlib and Pillow, which are not installed: pip install "mobee[film]"') from None
    folder = Path(get_data_path()) / "fonts" / "ttf"
    plain, bold = str(folder / "DejaVuSans.ttf"), str(folder / "DejaVuSans-Bold.ttf")
    return Fonts(*(ImageFont.truetype(file, size) for file, size in ((bold, 13), (bold, 12), (plain, 12), (plain, 11))))


def mixed(first: Color, second: Color, share: float) -> Color:
    """Return a mixture of two colours (red, green, blue; 0 to 255). `share`: weight of `second`, 0 to 1."""
    red, green, blue = (round((1.0 - share) * a + share * b) for a, b in zip(first, second, strict=True))
    return red, green, blue


def dot(ink: Any, at: tuple[float, float], radius: float, fill: Color | None, rim: Color | None = None, width: int = 1) -> None:
    """Draw a disc at the pixel `at` (x, y) with a radius in pixels.

    `ink`: drawing context of Pillow (ImageDraw). `fill`: colour of the disc; None: not filled. `rim`: colour of the outline, `width` pixels
    wide; None: no outline.
    """
    x, y = at
    ink.ellipse((x - radius, y - radius, x + radius, y + radius), fill=fill, outline=rim, width=width if rim else 0)


def write(ink: Any, x: float, y: float, runs: Sequence[tuple[str, Any, Color]], width: float, rows: int, height: float) -> float:
    """Write text from the pixel (x, y), with line breaks at blanks, and return the y below the last line.

    `ink`: drawing context of Pillow (ImageDraw). `runs`: pieces of text as (text, font, colour), written one after the other. `width`:
    width of a line [pixels]. `rows`: largest number of lines; text that does not fit is replaced by an ellipsis. `height`: height of a line
    [pixels].
    """
    blank = runs[0][1].getlength(" ")
    at, row = 0.0, 0
    for text, font, color in runs:
        for word in text.split():
            long = font.getlength(word)
            if at > 0.0 and at + long > width:
                at, row = 0.0, row + 1
            if row == rows:
                ink.text((x + width, y + (rows - 1) * height), "…", font=font, fill=color, anchor="ra")
                return y + rows * height
            ink.text((x + at, y + row * height), word, font=font, fill=color)
            at += long + blank
    return y + (row + 1) * height
