# SPDX-License-Identifier: Apache-2.0
"""The cases of `mobee bench against`; each runs in a fresh process, with the library and the workloads of the checkout that is measured.

    PYTHONPATH=CHECKOUT python -P against_cases.py CASE

Checkouts back to commit 10a73fe can be measured: `_first` finds modules that had another name then.  The process prepares the case and does
its work once to warm up.  Then it does the work again for every line of its standard input.  Each time it prints a line of JSON with the
processor time and the counts of the work.  If the counts of two checkouts are equal, both did the same work.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

Done = tuple[float, dict[str, float]]  # processor time [s], and counts of the work done
Work = Callable[[], Done]

STRATEGIES = ("random", "greedy", "intrinsic")
PLANTS = 64
REACH_SCALE = 0.01  # m, of all checkouts
TRIES = 100  # of 6400 of a run of chapter 8
LOCKSTEP_TICKS = (100, 3100)  # of two runs: their difference is without the start


def main() -> None:
    """Prepare the case that the command line names, then do its work once for every line of standard input.

    Prints lines of JSON: first a dict with the path of the "library", then for each line a dict with "seconds", the time, and "work", the
    counts of the work.
    """
    import mobee

    name = sys.argv[1]
    if name not in SEVERAL_CORES and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    work = CASES[name]()
    if name != "lockstep":  # which has had a short run
        work()
    print(json.dumps({"library": str(mobee.__file__)}), flush=True)
    for _ in sys.stdin:
        seconds, done = work()
        print(json.dumps({"seconds": seconds, "work": done}), flush=True)


def _first(*names: str) -> Any:
    """Return the first of these modules that the checkout has."""
    for name in names:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if not name.startswith(error.name or " "):
                raise
    raise ModuleNotFoundError(f"neither {' nor '.join(names)} is in this checkout")


def _plant_workload() -> Any:
    return _first("experiments.bench.plant_workload", "experiments.bench.plant")  # old first: `plant` was once another module


def _one_arm() -> Work:
    workload = _plant_workload()

    def work() -> Done:
        pace = workload.one_arm(workload.arm_plant(), 300)
        return pace.seconds, {"ticks": pace.ticks, "actions": pace.ended}

    return work


def _many_plants() -> Work:
    """Measure actions of an arm: in a batch of plants if the checkout has batches, else on one plant.

    The number of actions is the same.
    """
    import mobee

    workload = _plant_workload()
    DT, LEFT, SEED = workload.DT, workload.LEFT, workload.SEED
    body, together = workload.robot(), getattr(mobee, "advance_together", None)
    gains, count = mobee.Gains.published_2014(), PLANTS if together else 1
    plants = [mobee.OfflinePlant(mobee.Model(body), SEED + k, gains, dt=DT, active=LEFT) for k in range(count)]
    space = mobee.Lattice(body, LEFT, workload.LEVELS)
    states = np.random.default_rng(SEED).integers(len(space), size=10 * PLANTS)
    goals = [space.target(int(state)) for state in states]

    def act() -> None:
        if together is None:
            for goal in goals:
                plants[0].act("left_arm", goal)
            return
        for first in range(0, len(goals), PLANTS):
            for plant, goal in zip(plants, goals[first : first + PLANTS], strict=True):
                plant.begin("left_arm", goal)
            together(plants)

    def work() -> Done:
        before = sum(plant.time for plant in plants)
        seconds = _seconds(act)
        return seconds, {"plants": count, "ticks": round((sum(plant.time for plant in plants) - before) / DT)}

    return work


def _reaching() -> Work:
    workload = _plant_workload()

    def work() -> Done:
        pace = workload.one_arm_reaching(workload.arm_plant(), 100)
        return pace.seconds, {"ticks": pace.ticks, "reaches": pace.ended}

    return work


def _three_agents() -> Work:
    workload = _plant_workload()

    def work() -> Done:
        pace = workload.three_agents(300)
        return pace.seconds, {"ticks": pace.ticks, "transitions": pace.ended}

    return work


def _chapter_8() -> Work:
    """Return the work of learning to reach (thesis chapter 8), 1/64 of the full size, with each of the strategies in STRATEGIES.

    A strategy decides what the agent tries next.  First an agent explores: 3000 / 64 transitions for each strategy.  Then each strategy
    makes 100 (TRIES) of its 6400 tries (attempts to reach a target), and is evaluated once on every second target.
    """
    arm = _first("experiments.kit.reaching.arm", "experiments.reaching.scene")
    learning = _first("experiments.kit.reaching.learning", "experiments.reaching.looks")
    targets = _first("experiments.kit.reaching.targets", "experiments.reaching.targets")
    from mobee.learning.reaching.reach_agent import ReachAgent

    problems = targets.targets_at(targets.grid(), arm.laws()["published"].aim)
    beliefs = arm.learned_beliefs(arm.reach_plant(0), 0, 3000)

    def run(strategy: str) -> float:
        plant = arm.reach_plant(0)
        agent = ReachAgent(arm.reach_space(), plant, beliefs, marker=arm.MARKER, strategy=strategy, scale=REACH_SCALE, seed=0)
        learning.learn(agent, problems, (TRIES,), 1, {"few": problems[::2]})
        return float(plant.time)

    def work() -> Done:
        count = len(STRATEGIES) * 3000 * TRIES // 6400
        exploring = _seconds(lambda: arm.learned_beliefs(arm.reach_plant(0), 0, count))
        times: list[float] = []
        trying = _seconds(lambda: times.extend(map(run, STRATEGIES)))
        return exploring + trying, {"plant seconds": round(sum(times), 3)}

    return work


def _lockstep() -> Work:
    """Return the work of the live system in lockstep: the processor time of all its processes for 3000 ticks.

    Each time a short run and a run with 3000 more ticks are made; their difference does not contain the start of the services.
    """
    summary_of = _first("experiments.kit.live.launch", "experiments.kit.live", "experiments.launched").summary_of

    def run(ticks: int) -> tuple[float, dict[str, Any]]:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        summary = summary_of("lockstep", ("services.robot_sim.backend=kinematic", "services.robot_sim.rate=50"), ticks=ticks)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, summary["lockstep"]

    run(LOCKSTEP_TICKS[0])  # compiles what old checkouts compile at first use

    def work() -> Done:
        short, long = (run(ticks) for ticks in LOCKSTEP_TICKS)
        return long[0] - short[0], {"ticks": long[1]["ticks"] - short[1]["ticks"]}

    return work


def _value_iteration(warm: bool) -> Work:
    from mobee.learning.value_iteration import value_iteration

    problems = _first("experiments.bench.vi_workload", "experiments.bench.vi")
    known = (getattr(problems, "after_transitions", None) or problems.at_work)(1000, 100)
    tables = known.tables

    def solve(start: Any) -> Any:
        return value_iteration(tables, tables.reward, 0.9, 1e-3, start, method="modified")[0]

    def cold() -> None:
        for _ in range(2000):
            solve(None)

    def after_changes() -> None:
        start = solve(None)
        for _ in range(20):
            for change in known.changes:
                tables.put(change)
                start = solve(start)

    return lambda: (_seconds(after_changes if warm else cold), {"states": len(tables.reward)})


def _inverse_kinematics(method: Any, count: int) -> Work:
    import mobee

    workload = _first("experiments.bench.ik_workload", "experiments.bench.ik")
    model = workload.scene()
    aims = workload.targets(model, count)

    def work() -> Done:
        found: list[Any] = []

        def solve() -> None:
            for seed, aim in enumerate(aims):
                found.append(mobee.solve_ik(model, aim.costs(), seed=seed, motors=workload.MOTORS, method=method, evaluations=20_000))

        return _seconds(solve), {"reached": sum(one.reached for one in found), "evaluations": sum(one.evaluations for one in found)}

    return work


def _roadmap(method: Any, spacing: float) -> Work:
    tasks = _first("experiments.claims.ch3_roadmaps.trm_tasks", "experiments.trm.pregrasp")
    build = _first("experiments.kit.roadmap_task", "experiments.trm.building").build
    pregrasp = getattr(tasks, "pregrasp", None) or tasks.example  # today all tasks are in one module, then each had its own

    wanted = replace(pregrasp(), margin=0.0, spacing=spacing)

    def work() -> Done:
        found: list[Any] = []
        seconds = _seconds(lambda: found.append(build(wanted, method, neighbours=8)))
        return seconds, {"vertices": len(found[0].q), "evaluations": found[0].settings["evaluations"]}

    return work


def _edges() -> Work:
    from mobee.roadmap.edges import checked

    workload = _first("experiments.bench.edges_workload", "experiments.bench.edges")
    roadmap = workload.palm_map(0.015)

    def work() -> Done:
        found: list[Any] = []
        seconds = _seconds(lambda: found.append(checked(roadmap.model, roadmap.q, roadmap.edges, marker=workload.MARKER)))
        return seconds, {"edges": len(roadmap.edges), "poses": found[0].poses, "free": int(np.sum(found[0].free))}

    return work


def _seconds(run: Callable[[], object]) -> float:
    start = time.process_time()
    run()
    return time.process_time() - start


CASES: dict[str, Callable[[], Work]] = {
    "one arm": _one_arm,
    "64 plants": _many_plants,
    "reaching": _reaching,
    "three agents": _three_agents,
    "chapter 8": _chapter_8,
    "lockstep": _lockstep,
    "vi cold": lambda: _value_iteration(warm=False),
    "vi warm": lambda: _value_iteration(warm=True),
    "ik least squares": lambda: _inverse_kinematics("hybrid", 100),
    "ik evolution": lambda: _inverse_kinematics("nes", 10),
    "trm least squares": lambda: _roadmap("least_squares", 0.02),
    "trm evolution": lambda: _roadmap("nes", 0.08),
    "edges": _edges,
}
SEVERAL_CORES = ("lockstep", "trm least squares", "trm evolution")

if __name__ == "__main__":
    main()
