# SPDX-License-Identifier: Apache-2.0
"""The text of a film: a card for each agent, and curves of how many of its actions each agent has tried."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mobee.rendering.palette import Color
from services.monitor.film.ink import GROUND, LINE, MISSED, OTHERS, PANEL, QUIET, REACHED, TEXT, Fonts, dot, write
from services.monitor.story.words import title_of

MOST = 3  # agents
CARD, GAP, INSET, ROW = 92, 6, 10, 15.0  # pixels: height of a card, between cards, inside of them, of a line
TITLE, AXIS = 20, 13  # pixels above a curve, for its title, and below
SOON = 20  # transitions up to which a comparison says nothing
REMARKS = ("dots: places of a hand; bright: much left to learn there,", "dark: learned. White: the action under way")
LEAST_KNOWN = 0.05  # share at the top of the curves' axis, at least


class StoryView:
    """Draws a card and a learning curve for each of at most MOST (3) agents.

    A card is a panel with text: the agent's present action, the outcome of the last action, and how much the agent knows.
    """

    def __init__(self, colors: Mapping[str, Color], fonts: Fonts) -> None:
        """Create the view; `colors`: colour of each part."""
        self._colors, self._fonts = colors, fonts

    def draw(self, ink: Any, values: dict[str, Any], box: tuple[int, int, int, int]) -> None:
        """Draw the cards of the agents (panels with text), one below the other, and below them a panel with their learning curves.

        `ink`: drawing context of Pillow. `values`: recorded values at one time, as returned by `services.monitor.past.Story.at`. `box`:
        left, top, right and bottom [pixels].
        """
        left, top, right, bottom = box
        cards = values.get("cards", [])[:MOST]
        for card in cards:
            self._card(ink, card, (left, top, right, top + CARD))
            top += CARD + GAP
        ink.rounded_rectangle((left, top, right, bottom), 6, fill=PANEL, outline=LINE)
        ink.text((left + INSET, top + 5), "What it knows: share of its actions tried", font=self._fonts.small, fill=TEXT)
        ink.text((right - INSET, top + 5), "dotted: at random", font=self._fonts.small, fill=QUIET, anchor="ra")
        wide = (right - left) / max(1, len(cards))
        for number, part in enumerate(card["part"] for card in cards):
            if part in values.get("curves", {}):
                others = values.get("baselines", {}).get(part, {}).get("random", [])
                inner = (round(left + number * wide) + INSET, top + 22, round(left + (number + 1) * wide) - INSET, bottom - 5)
                self._curve(ink, part, values["curves"][part], others, inner)

    def _card(self, ink: Any, card: dict[str, Any], box: tuple[int, int, int, int]) -> None:
        left, top, right, _ = box
        hue, fonts = self._colors[card["part"]], self._fonts
        ink.rounded_rectangle(box, 6, fill=PANEL, outline=LINE)
        ink.rectangle((left, top + 4, left + 3, box[3] - 4), fill=hue)
        x, width = left + INSET + 2, right - left - 2 * INSET - 2
        ink.text((x, top + 5), card["title"], font=fonts.title, fill=hue)
        if "n" in card:
            known = f"{card['n']} transitions, {100 * card['predictable']:.0f} % of its actions predictable"
            ink.text((right - INSET, top + 6), known, font=fonts.small, fill=QUIET, anchor="ra")
        y = float(top + 23)
        now = card.get("reach") or card.get("now")
        if now:
            y = write(ink, x, y, [(now, fonts.strong, TEXT), (card.get("expects", ""), fonts.text, TEXT)], width, 3, ROW)
        else:
            y = write(ink, x, y, [("It chooses its next action.", fonts.text, QUIET)], width, 1, ROW)
        last = card.get("last")
        if last and y + ROW < box[3]:
            shade = REACHED if last["reached"] else MISSED
            runs = [("Last", fonts.text, QUIET), (last["outcome"], fonts.text, shade), (_surprise(last), fonts.text, TEXT)]
            write(ink, x, y, runs, width, int((box[3] - y) // ROW), ROW)

    def _curve(self, ink: Any, part: str, curve: list[Any], others: list[Any], box: tuple[int, int, int, int]) -> None:
        left, top, right, bottom = box
        hue, (newest, known), small = self._colors[part], curve[-1][:2], self._fonts.small
        ink.text((left, top), f"{title_of(part)} {100 * known:.0f} %", font=small, fill=hue)
        random = others[-1][1] if others and newest > SOON else 0.0
        if random > 0.0:
            ink.text((right, bottom - AXIS + 2), f"{known / random:.1f} × random", font=small, fill=TEXT, anchor="ra")
        top, bottom = top + TITLE, bottom - AXIS
        if newest < SOON:
            curve = [(0, 0.0, 0.0), *curve]  # the agent has begun in this run
        highest = max(LEAST_KNOWN, known, *(point[1] for point in others), 0.0)

        def at(point: Any) -> tuple[float, float]:
            return left + (right - left) * point[0] / max(1, newest), bottom - (bottom - top) * point[1] / highest

        ink.line((left, bottom, right, bottom), fill=LINE)
        for point in others[1::2]:
            dot(ink, at(point), 0.8, OTHERS)
        ink.line([at(point) for point in curve], fill=hue, width=2)
        dot(ink, at(curve[-1]), 3.0, hue)


def _surprise(last: dict[str, Any]) -> str:
    """Return the text about the agent's surprise at its last action, without the clause about how much it learned."""
    text, comma, _ = str(last["surprise"]).partition(", learned")
    return text + "." * bool(comma)


def heading(ink: Any, name: str, moment: float, fonts: Fonts) -> None:
    """Write the title of the film with the robot's `name`, and the robot's time `moment` [s since the begin of the run].

    `ink`: drawing context of Pillow.
    """
    ink.text((12, 8), f"MoBeE: {name}", font=fonts.title, fill=TEXT)
    minutes, seconds = divmod(round(moment), 60)
    if minutes >= 60:
        passed = f"{minutes // 60} h {minutes % 60:02d} min"
    else:
        passed = f"{minutes} min {seconds:02d} s" if minutes else f"{seconds} s"
    ink.text((12, 26), f"{passed} after the start", font=fonts.small, fill=QUIET)


def remarks(ink: Any, below: int, fonts: Fonts) -> None:
    """Write the legend for the dots and lines in the picture of the robot.

    `ink`: drawing context of Pillow. `below`: y of the lower edge of the picture [pixels].
    """
    top, long = below - 14 * len(REMARKS) - 10, max(fonts.small.getlength(text) for text in REMARKS)
    ink.rounded_rectangle((6, top, 18 + long, below - 4), 5, fill=GROUND)
    for row, text in enumerate(REMARKS):
        ink.text((12, top + 3 + 14 * row), text, font=fonts.small, fill=QUIET)
