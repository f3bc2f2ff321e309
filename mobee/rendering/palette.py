# SPDX-License-Identifier: Apache-2.0
"""The colours of robots, worlds and plots: 8-bit red, green, blue, and opacity where given."""

from __future__ import annotations

from collections.abc import Collection, Sequence

Color = tuple[int, int, int]
Rgba = tuple[int, int, int, int]

JOINTS: tuple[Color, ...] = ((76, 154, 255), (255, 171, 64), (102, 205, 130), (214, 122, 232))
PARTS: dict[str, Color] = {"torso": (255, 202, 97), "left_arm": (86, 180, 233), "right_arm": (232, 120, 170)}
FORCES: tuple[Color, ...] = ((120, 170, 255), (190, 140, 255), (255, 92, 82), (255, 202, 97), (102, 205, 130), (170, 170, 180))
FIELD = (90, 200, 220, 28)
CONTACT = (255, 92, 82)
TOUCHED = (255, 50, 40, 130)
TABLE = (150, 138, 120, 255)
BALL = (225, 40, 40, 255)
OTHER = (170, 170, 180, 255)
COLLIDING = (255, 50, 40, 255)
MARKER = (255, 214, 64)
SOLIDS: tuple[Color, ...] = (
    (150, 160, 176),
    (176, 162, 140),
    (118, 152, 190),
    (186, 132, 156),
    (130, 172, 142),
    (172, 150, 196),
)  # by part
SHOWN_PARTS = 3  # of a robot with other parts: so many columns of plots fit on the page


def colors_of(parts: Collection[str]) -> dict[str, Color]:
    """Return the parts that plots and learning curves show, with their colours (8-bit red, green, blue).

    They are the iCub's torso and arms, or the first three parts of another robot.
    """
    if PARTS.keys() <= set(parts):
        return PARTS
    return dict(zip(list(parts)[:SHOWN_PARTS], PARTS.values(), strict=False))


MORE_PARTS: tuple[Color, ...] = ((124, 214, 150), (178, 150, 255), (240, 150, 90), (120, 200, 200), (210, 200, 120))


def colors_of_all(parts: Collection[str]) -> dict[str, Color]:
    """Return all `parts` of a robot with their colours (8-bit red, green, blue).

    The parts in `colors_of` have their colours there. All others get five further colours in turn, which repeat after five parts.
    """
    known = colors_of(parts)
    rest = [part for part in parts if part not in known]
    return {part: known[part] if part in known else MORE_PARTS[rest.index(part) % len(MORE_PARTS)] for part in parts}


def faded(color: Color, share: float) -> Color:
    """Return the colour mixed with the dark background; `share`: share of the colour, 0 to 1."""
    red, green, blue = (round(share * channel) for channel in color)
    return red, green, blue


def of_object(kind: str, role: str, given: Sequence[float] | None = None) -> Rgba:
    """Return the colour of a world object: red, green, blue and opacity, each 0 to 255.

    `kind`: kind of its volume, such as "box". `role`: "obstacle", "target" or "ghost". `given`: red, green, blue and opacity, each 0 to 1;
    None: the colour of the role and kind.
    """
    if given is not None:
        red, green, blue, opacity = (round(255 * channel) for channel in given)
        return red, green, blue, opacity
    return BALL if role == "target" else TABLE if kind == "box" else OTHER
