"""Draw docs/figures/model_cost.png: what a pose costs against objects and primitives.  Run time: about two minutes."""

from __future__ import annotations

from pathlib import Path

from experiments.bench.model_cost import draw, empty_figure, measure

FIGURE = Path(__file__).parents[2] / "docs" / "figures" / "model_cost.png"


def main() -> None:
    draw(empty_figure(), measure(rounds=9), FIGURE)
    print(FIGURE)


if __name__ == "__main__":
    main()
