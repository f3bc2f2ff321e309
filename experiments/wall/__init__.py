"""A hand is driven by ever more force into the table, the own body and the joint limits; and drawn to and through singular poses.

Claim: with the default gains no force of a client drives a solid deeper than 2 mm into anything or an arm beyond a constraint or a
limit; and a hand that is drawn to a target, reachable or not, through singular poses or not, never stops dead on its way and does
not oscillate above 1 mm when it has come to rest.  Source: thesis 5.2.2-5.2.4 (f_config and f_work are bounded so that they "not
dominate the constraint forces") and 5.1 (J^T control of an unreachable target "will cause the robot to oscillate").
Published: no numbers.  Run time: about six minutes.

The force rises in steps, each in force for two seconds, for both gain sets.  Depths are of the joints' true positions.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.control.ride import GAINS
from experiments.control.walls import WALLS
from experiments.kit.progress import Progress
from experiments.kit.records import Records, read_records
from experiments.wall.drawn import DRAWN, Drawn, draw_hand
from experiments.wall.figure import draw
from experiments.wall.pressing import Pressed, press

NAME = "wall"
CLAIM = "no force of a client drives the robot into table, body or limits, and a hand drawn through singular poses stays calm"
SOURCE = "thesis 5.1 and 5.2.2-5.2.4"

PRESSED, DRAWN_TO = "pressed.csv", "drawn.csv"
SOLID, CLAUSE = 2.0, 2.0  # mm, degrees: allowed with the default gains
OSCILLATION, DEAD = 1.0, 0.3  # mm at rest; s without motion on the way


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--gains", nargs="+", choices=GAINS, default=list(GAINS), metavar="SET", help=f"of {', '.join(GAINS)}")
    parser.add_argument("--walls", nargs="+", choices=tuple(WALLS), default=list(WALLS), metavar="WALL", help=f"of {', '.join(WALLS)}")
    parser.add_argument("--targets", nargs="*", choices=tuple(DRAWN), default=list(DRAWN), metavar="TARGET", help=f"of {', '.join(DRAWN)}")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Press into every wall, then draw the hand to every target."""
    pressed, drawn = read(folder)
    begun, reached = {(p.gains, p.wall) for p in pressed}, {(d.gains, d.target) for d in drawn}
    cases = len(arguments.gains) * (len(arguments.walls) + len(arguments.targets))
    with (
        Records(folder / PRESSED, Pressed.columns()) as presses,
        Records(folder / DRAWN_TO, Drawn.columns()) as draws,
        Progress() as progress,
    ):
        for gains in arguments.gains:
            for wall in arguments.walls:
                if (gains, wall) not in begun:
                    for level in press(gains, wall, arguments.seed):
                        presses.append(level.record())
                    begun.add((gains, wall))
                progress.show((len(begun) + len(reached)) / cases, f"{gains}: into {wall}")
            for target in arguments.targets:
                if (gains, target) not in reached:
                    drawn_hand, way = draw_hand(gains, target, arguments.seed)
                    way.save(folder, gains, target)
                    draws.append(drawn_hand.record())
                    reached.add((gains, target))
                progress.show((len(begun) + len(reached)) / cases, f"{gains}: drawn to {target}")
    return results(*read(folder))


def read(folder: Path) -> tuple[list[Pressed], list[Drawn]]:
    """What a run has so far."""
    pressed = [Pressed.of_record(row) for row in read_records(folder / PRESSED, Pressed.columns())]
    return pressed, [Drawn.of_record(row) for row in read_records(folder / DRAWN_TO, Drawn.columns())]


def results(pressed: list[Pressed], drawn: list[Drawn]) -> dict[str, Any]:
    """The worst of every wall, and of the hand that is drawn."""
    table: dict[str, Any] = {}
    for gains in dict.fromkeys([*(p.gains for p in pressed), *(d.gains for d in drawn)]):
        mine = [p for p in pressed if p.gains == gains]
        table[gains] = {
            wall: {
                "solid_mm": max(p.solid_mm for p in mine if p.wall == wall),
                "pair": max((p for p in mine if p.wall == wall), key=lambda p: p.solid_mm).pair or "none",
                "field_mm": max(p.field_mm for p in mine if p.wall == wall),
                "clause_deg": max(p.clause_deg for p in mine if p.wall == wall),
                "limit_deg": max(p.limit_deg for p in mine if p.wall == wall),
                "restless_mm": max(p.restless_mm for p in mine if p.wall == wall),
            }
            for wall in dict.fromkeys(p.wall for p in mine)
        } | {
            f"drawn: {d.target}": {"oscillation_mm": d.oscillation_mm, "dead_s": d.dead_s, "from_target_mm": d.from_target_mm}
            for d in drawn
            if d.gains == gains
        }
    safe = all(p.solid_mm <= SOLID and p.clause_deg <= CLAUSE for p in pressed if p.gains == "default")
    calm = all(d.oscillation_mm <= OSCILLATION and d.dead_s <= DEAD for d in drawn if d.gains == "default")
    return {"passed": safe and calm if "default" in table else None, **table}  # the claim is about the default gains


def figure(folder: Path) -> Path:
    """Depth against force, and the hand's way to its targets."""
    return draw(*read(folder), folder / "wall.png")
