"""Cells on a Ray cluster: the one that is running here, or one of this machine's cores."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

from experiments.kit.cells import Cell, Work
from experiments.kit.processes import Done, do
from mobee.errors import MobeeError


class RayMissing(MobeeError):
    """Raised when Ray is asked for and not installed."""


def on_ray(work: Work, cells: Sequence[Cell], jobs: int | None) -> Iterator[Done]:
    """Yield the cells as they are finished, in any order; MoBeE must be installed on all machines of the cluster."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is reported to anybody
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # what Ray will do by itself one day; silences its warning
    try:
        import ray
    except ImportError:
        raise RayMissing("--engine ray needs Ray, which is not installed: pip install '.[cluster]' in MoBeE's folder") from None
    try:
        ray.init(address="auto", log_to_driver=False, logging_level=logging.ERROR)
    except ConnectionError:
        ray.init(num_cpus=jobs, include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR)
    try:
        remote = ray.remote(max_retries=0)(do)
        waiting = deque(cells)
        running: dict[Any, Cell] = {}
        room = jobs or max(1, int(ray.cluster_resources().get("CPU", 1)))
        while waiting or running:
            while waiting and len(running) < room:
                cell = waiting.popleft()
                running[remote.remote(work, cell)] = cell
            (ready, *_), _ = ray.wait(list(running))
            cell = running.pop(ready)
            try:
                yield ray.get(ready)
            except ray.exceptions.RayError as error:
                yield Done(cell, 0.0, None, f"its process died: {str(error).strip().splitlines()[0]}")
    finally:
        ray.shutdown()
