# SPDX-License-Identifier: Apache-2.0
"""Engines that run the cells of a sweep (single runs, each with its settings and seed): processes of this machine, or a Ray cluster."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import connection, get_context, parent_process
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, cast

from experiments.kit.cells import Cell, Work
from mobee.errors import MobeeError

_THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # set here too: not every caller comes from mobee_cli
_END_TIMEOUT = 40.0  # s, for a process to end: its cell may first have to stop a live system, which takes up to 30 s


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_processes(work: Work, cells: Sequence[Cell], jobs: int | None) -> Iterator[Done]:
    """Run the cells (single runs) in `jobs` processes of this machine, and yield the result of each as it finishes, in any order.

    With one job, the cells run in this process.  `work`: computes the values of a cell; a function of a module, so that other processes can
    import it.  `jobs`: None: one for each processor core.
    """
    count = min(jobs or cores(), len(cells))
    if count == 1:
        yield from (do(work, cell) for cell in cells)
        return
    waiting = deque(cells)
    with ExitStack() as stack:
        workers = {worker.answers: worker for worker in (_Worker(work) for _ in range(count))}
        stack.callback(lambda: _end(list(workers.values())))
        for worker in workers.values():
            worker.give(waiting.popleft())
        while busy := [answers for answers, worker in workers.items() if worker.cell is not None]:
            ready = connection.wait(busy)
            for answers in [one for one in busy if one in ready]:
                worker = workers.pop(answers)
                done = worker.take()
                if not worker.is_whole and waiting:
                    worker = _Worker(work)
                workers[worker.answers] = worker
                if waiting:
                    worker.give(waiting.popleft())
                yield done


class _Worker:
    """A process that runs one cell after another."""

    def __init__(self, work: Work) -> None:
        context = get_context("spawn")
        self.answers, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(target=_serve, args=(work, theirs), daemon=True)
        with _worker_environment():
            self.process.start()
        theirs.close()
        self.cell: Cell | None = None
        self.is_whole = True

    def give(self, cell: Cell) -> None:
        """Start a cell."""
        self.cell = cell
        try:
            self.answers.send(cell)
        except OSError:  # the process has died; `take` reports how
            self.is_whole = False

    def take(self) -> Done:
        """Return the cell that has ended; if the process died, with the reason."""
        cell, self.cell = self.cell, None
        if cell is None:
            raise RuntimeError("no cell is under way in this process")
        try:
            done: Done = self.answers.recv()
            return done
        except (EOFError, OSError):
            self.is_whole = False
            self.process.join(_END_TIMEOUT)
            return Done(cell, 0.0, None, f"its process died: {_exit_reason(self.process.exitcode)}")


def _serve(work: Work, cells: Connection) -> None:
    with _signals_of_cells():
        threading.Thread(target=_end_with_parent, daemon=True).start()  # its signals stay blocked: this thread must get them
    while True:
        try:
            cell = cells.recv()
        except EOFError:
            return
        done = do(work, cell)
        try:
            cells.send(done)
        except (TypeError, ValueError, AttributeError) as error:  # values that cannot be sent
            cells.send(Done(cell, done.seconds, None, f"what it returned cannot be sent to another process: {error}"))


@contextmanager
def _signals_of_cells() -> Iterator[None]:
    """Let this process end by SystemExit on SIGTERM, so that a cell stops the processes that it has started, and do nothing on Ctrl-C.

    Inside the context both signals are blocked.  Afterwards they are not, because the processes that a cell starts inherit this.
    """
    both = {signal.SIGTERM, signal.SIGINT}
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, both)
    signal.signal(signal.SIGTERM, _end_once)
    signal.signal(signal.SIGINT, lambda *_: None)
    yield
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, both)


def _end_once(*_: object) -> None:
    """End this process by SystemExit; a second signal must not interrupt what the cell does then."""
    signal.signal(signal.SIGTERM, lambda *_: None)
    sys.exit(1)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_END_TIMEOUT)
        os._exit(1)


def _exit_reason(code: int | None) -> str:
    if code is not None and code < 0:
        return f"killed by signal {-code} ({signal.Signals(-code).name}); if memory is short, use fewer --jobs"
    return f"exit code {code}"


def _end(workers: Sequence[_Worker]) -> None:
    for worker in workers:
        worker.process.terminate()
    give_up = time.monotonic() + _END_TIMEOUT
    for worker in workers:
        worker.process.join(max(0.0, give_up - time.monotonic()))
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()
        worker.answers.close()


@contextmanager
def _worker_environment() -> Iterator[None]:
    """Let processes started in this context ignore Ctrl-C, and use one thread each for linear algebra.

    The starting process handles Ctrl-C.
    """
    before = {name: os.environ.get(name) for name in _THREAD_LIMITS}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if hasattr(signal, "pthread_sigmask") else None
    os.environ.update(dict.fromkeys(_THREAD_LIMITS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@dataclass(frozen=True)
class Done:
    """A cell (one run of an experiment, with its settings and seed) that has ended.

    `seconds`: duration of the run.  `values`: what the run returned, by name; None if it failed.  `error`: the traceback, or how its
    process died; "" if the run succeeded.
    """

    cell: Cell
    seconds: float
    values: dict[str, Any] | None
    error: str = ""  # a traceback, or how its process died

    @property
    def reason(self) -> str:
        """The last line of the error text; "" if the run succeeded."""
        return self.error.strip().rpartition("\n")[2]


def do(work: Work, cell: Cell) -> Done:
    """Run `work` on a cell (a single run), and return its values and duration; of an exception, the traceback is returned as `error`."""
    start = time.monotonic()
    try:
        values = work(cell)
    except Exception:  # of the experiment's own code: it is reported with the cell's name, and the other cells continue
        return Done(cell, time.monotonic() - start, None, traceback.format_exc())
    if not isinstance(values, dict):
        return Done(cell, time.monotonic() - start, None, f"its trial returned {values!r}: return a dict of values by name")
    return Done(cell, time.monotonic() - start, values)


class RayMissing(MobeeError):
    """Raised if the engine "ray" is selected and the package Ray is not installed."""


def on_ray(work: Work, cells: Sequence[Cell], jobs: int | None) -> Iterator[Done]:
    """Run the cells (single runs) on the Ray cluster that this machine belongs to, and yield the result of each as it finishes.

    Without a cluster, Ray runs the cells on this machine alone.  `work`: computes the values of a cell; a function of a module.  `jobs`:
    number of cells that run at the same time; None: one for each processor.  MoBeE must be installed on all machines of the cluster.
    Raises RayMissing.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # sends no usage statistics
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # Ray's future default; silences its warning
    try:
        import ray
    except ImportError:
        raise RayMissing('--engine ray needs Ray, which is not installed: pip install "mobee[cluster]"') from None
    try:
        ray.init(address="auto", log_to_driver=False, logging_level=logging.ERROR)
    except ConnectionError:
        ray.init(num_cpus=jobs, include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR)
    try:
        remote = ray.remote(max_retries=0)(do)
        waiting = deque(cells)
        running: dict[Any, Cell] = {}
        capacity = jobs or max(1, int(cast(Any, ray).cluster_resources().get("CPU", 1)))
        while waiting or running:
            while waiting and len(running) < capacity:
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
