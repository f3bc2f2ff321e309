"""Build the map of a task and draw it (thesis figs. 3.1-3.11).

    python -m experiments.trm TASK [TASK ...] [--method least_squares] [--out FOLDER]

Writes TASK.npz, which `mobee roadmap` reads, too, TASK_cloud.png and TASK_film.png; with several tasks also films_one_hand.png,
films_both_hands.png and clouds.png, all on one sheet.  A map that is there already is not built again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from experiments.drawing.filmstrip import Strip, filmstrip
from experiments.drawing.sheet import write_sheet
from experiments.trm.body import LEFT_ARM
from experiments.trm.building import Method, build
from experiments.trm.examples import EXAMPLES
from experiments.trm.pictures import cloud_panel, draw_cloud, draw_film, strip_of
from mobee import MobeeError

METHODS: tuple[Method, ...] = ("least_squares", "nes", "hybrid")
SHEET, COLORS = 140, 48  # pixels, the height of a picture on a sheet
COLUMNS = 4


def main(argv: Sequence[str] | None = None) -> None:
    """Build and draw."""
    parser = argparse.ArgumentParser(description="Build the maps of tasks and draw them.")
    parser.add_argument("tasks", nargs="+", choices=[*EXAMPLES, "all"], metavar="TASK", help=f"all, or of {', '.join(EXAMPLES)}")
    parser.add_argument("--method", choices=METHODS, default=METHODS[0], help="how poses are found (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is drawn (default: 0)")
    parser.add_argument("--out", type=Path, default=Path(), metavar="FOLDER", help="where to (default: here)")
    options = parser.parse_args(argv)
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        draw_all(list(EXAMPLES) if "all" in options.tasks else options.tasks, options.method, options.seed, options.out)
    except MobeeError as error:
        raise SystemExit(str(error)) from None


def draw_all(tasks: Sequence[str], method: Method, seed: int, out: Path) -> None:
    """Every task's map and pictures, told line by line, and the sheets."""
    strips: dict[str, list[Strip]] = {}
    clouds = []
    for task in tasks:
        example = EXAMPLES[task]()
        roadmap = build(example, method, seed, out / f"{task}.npz")
        told = f"{len(roadmap.q)} poses, {len(roadmap.edges)} edges, {roadmap.settings['seconds']:.1f} s"
        pictures = draw_cloud(example, roadmap, out / f"{task}_cloud.png"), draw_film(example, roadmap, out / f"{task}_film.png")
        print(f"{task}: {told}; {', '.join(map(str, pictures))}")
        hands = "both_hands" if set(LEFT_ARM) <= set(example.motors) else "one_hand"
        strips.setdefault(hands, []).append(strip_of(example, roadmap))
        clouds.append(cloud_panel(example, roadmap, SHEET))
    if len(tasks) > 1:
        for name, chosen in strips.items():
            filmstrip(chosen, out / f"films_{name}.png", SHEET, COLORS)
        write_sheet([("", clouds[first : first + COLUMNS]) for first in range(0, len(clouds), COLUMNS)], out / "clouds.png")


if __name__ == "__main__":
    main()
