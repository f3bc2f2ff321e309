# SPDX-License-Identifier: Apache-2.0
"""An experiment with the options of the command line, in this process."""

from __future__ import annotations

import argparse

from experiments.kit.experiment import Experiment


def options_of(experiment: Experiment, *given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    experiment.method.add_arguments(parser)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(given)
    arguments.jobs = 1  # no other processes
    return arguments
