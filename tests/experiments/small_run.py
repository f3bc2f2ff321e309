# SPDX-License-Identifier: Apache-2.0
"""An experiment with the options of the command line, in this process."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.kit.experiment import Experiment


def options_of(experiment: Experiment, *given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    experiment.method.add_arguments(parser)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(given)
    arguments.jobs = 1  # no other processes
    return arguments


def small_run(experiment: Experiment, folder: Path, *given: str) -> dict[str, Any]:
    """Run it and draw its figure."""
    results = experiment.method.run(options_of(experiment, *given), folder)
    assert experiment.method.figure(folder).read_bytes().startswith(b"\x89PNG")
    return results
