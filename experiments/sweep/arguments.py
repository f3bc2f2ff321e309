"""Options that all sweeps have."""

from __future__ import annotations

import argparse

from experiments.options import positive_whole

ENGINES = ("processes", "ray")


def sweep_arguments(parser: argparse.ArgumentParser, seeds: int = 10) -> None:
    """Add --seeds, --jobs, --engine and --quick."""
    parser.add_argument(
        "--seeds", type=positive_whole, default=seeds, metavar="N", help=f"repetitions with different seeds (default: {seeds})"
    )
    parser.add_argument("--jobs", type=positive_whole, metavar="N", help="how many run at once (default: one a core)")
    text = "processes of this machine, or a Ray cluster (extra `cluster`; one of this machine's cores is started where none is)"
    parser.add_argument("--engine", choices=ENGINES, default="processes", help=f"{text} (default: processes)")
    parser.add_argument("--quick", action="store_true", help="a short version that shows whether it works")
