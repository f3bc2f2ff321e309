"""Draw docs/figures/plant_cost.png: what the offline plant costs against tick and objects.  Run time: about half a minute."""

from __future__ import annotations

from pathlib import Path

from experiments.bench.plant_cost import draw, empty_figure, measure

FIGURE = Path(__file__).parents[2] / "docs" / "figures" / "plant_cost.png"


def main() -> None:
    draw(empty_figure(), measure(actions=100), FIGURE)
    print(FIGURE)


if __name__ == "__main__":
    main()
