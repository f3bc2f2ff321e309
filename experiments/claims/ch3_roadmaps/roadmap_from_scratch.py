# SPDX-License-Identifier: Apache-2.0
"""Roadmap from scratch: random poses, joined without verification, and explored by the robot itself.

Claim: a map of 20 random samples, each joined to its 10 nearest neighbours without verifying an edge, is explored by commands alone;
infeasible edges are removed when they are found, until the feasible sub-graph is known.  Source: thesis 4.3.1, fig. 4.6.  Published:
"approximately 90 minutes" at 10 % of maximum velocity; "small, randomly generated graphs often contain unreachable vertices and edges".
Run time: a minute on 2 cores offline; `--live` about 15 minutes more.

Seven joints of the right arm of `icub` move beside its table, at 10 % speed under the default control law.  The robot is the offline plant,
with motor parameters that were identified on PyBullet; with `--live` also the real processes, in lockstep with PyBullet.  A vertex counts
as reached when every joint is within 0.15 rad of it; after a failed edge the arm moves back.  The next target is a vertex, drawn in
proportion to its number of untried edges.  When no untried edge can be reached any more, RRT-Connect plans a path to a vertex with untried
edges, up to three times per vertex.  At the end another plant tries every tried edge once more, from rest at its vertex, to see whether the
results agree.  The depths of solid contacts are measured only for pairs that the simulator tests: offline by the model, from the true joint
positions every 0.1 s, and live by PyBullet, in every tick.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CELL_FILES, load_cells
from experiments.kit.control.measures import is_listed
from experiments.kit.control.plant_runs import place
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, Steps, claim, judged
from experiments.kit.live.launch import TABLE, launch
from experiments.kit.live.system import CONTACTS, POSITIONS, read_touches
from experiments.kit.plots import new_figure, saved
from experiments.kit.rules import decides, within
from experiments.kit.run_folder import read, write
from experiments.kit.statistics import estimate, interval, share_interval
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import (
    ActionInterrupted,
    AdaptiveRoadmap,
    Gains,
    MapExplorer,
    MobeeError,
    Model,
    MotorParameters,
    OfflinePlant,
    Plant,
    Voronoi,
    load_robot,
    load_world,
)
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.roadmap.adaptive.record import MapStore
from mobee.roadmap.adaptive.walker import NEAR
from mobee.roadmap.ompl import query, require_ompl
from mobee.robot.robot import Robot
from services.common.bus_plant import BusPlant
from services.common.service import Service

ROBOT, PART, MARKER = "icub", "right_arm", "right_palm"
JOINTS, SAMPLES, NEIGHBOURS = 7, 20, 10  # thesis 4.3.1: 20 and 10, of the whole upper body
RATE, SPEED = 50.0, 0.1  # Hz; share of the motors' speed, thesis 4.3.1
MAX_EXTENSIONS = 500  # of a single query
MAX_DEPTH = 2e-3  # m, of a solid contact
SAMPLING = 5  # ticks, 0.1 s
JOB, DONE = "job.json", "done.json"


@cache
def robot() -> Robot:
    """Return the robot of this experiment, the iCub."""
    return load_robot(ROBOT)


def model() -> Model:
    """Return a model of the robot at its table."""
    return Model(robot(), load_world(str(TABLE)))


def joints() -> tuple[str, ...]:
    """Return the names of the seven motors of the right arm in which the poses of the roadmap differ."""
    return robot().parts[PART].motors[:JOINTS]


def new_map(seed: int) -> AdaptiveRoadmap:
    """Return a roadmap of 20 random poses, each joined to its 10 nearest neighbours; no edge is verified.  `seed`: of the poses."""
    return AdaptiveRoadmap(Voronoi(robot(), joints(), SAMPLES, seed, NEIGHBOURS))


def offline_plant(seed: int) -> OfflinePlant:
    """Return an offline plant of the right arm at 10 % speed, with the motor parameters that were identified on PyBullet.

    `seed`: of the encoder noise.
    """
    motors = MotorParameters.identified(ROBOT)
    return OfflinePlant(model(), seed, Gains.named("default"), motors, 1.0 / RATE, speed_scale=SPEED, active=joints())


def explorer(plant: Plant, seed: int, store: MapStore | None = None) -> MapExplorer:
    """Return an explorer of the roadmap of this seed, which moves `plant`.

    It repairs the map with paths of single-query planning (RRT-Connect) that avoid the table.  `store`: file of the observations; None: not
    stored.
    """
    paths = query(model(), joints(), robot().home, seed, MAX_EXTENSIONS)
    return MapExplorer(new_map(seed), plant, seed=seed, query=paths, store=store)


class Depth:
    """Records the deepest solid contact of a plant.

    Contacts between links are left out if the simulator does not test this pair of links.  The depth is computed by the model from the true
    positions of the motors every 0.1 s.  `deepest`: the depth [m].  `pair`: names of the two shapes.
    """

    def __init__(self, plant: OfflinePlant) -> None:
        self._plant = plant
        self.deepest, self.pair = 0.0, ""
        plant.every(SAMPLING, self._update)

    def _update(self, time: float) -> None:
        for contact in self._plant.model.evaluate(self._plant.motors.q).contacts:
            if contact.kind == "solid" and contact.depth > self.deepest and is_listed(contact.first, contact.second):
                self.deepest, self.pair = float(contact.depth), f"{contact.first} {contact.second}"


def explored(seed: int, most: int | None = None) -> dict[str, Any]:
    """Explore the roadmap of a seed on the offline plant, with at most `most` motions along edges (None: no limit).

    Returns the map and its observations with the keys of `outcome`, and: "finished", whether all reachable edges were tried; "why", the
    text of the error that ended the exploration, "" without one; "minutes", robot time [min] at the end of each motion; "deepest", depth
    [m] of the deepest solid contact, and "pair", the names of its two shapes; "agree" (E,), for each of the E tried edges whether another
    try had the same result.
    """
    plant = offline_plant(seed)
    depth, search = Depth(plant), explorer(plant, seed)
    minutes: list[float] = []
    finished, reason = False, ""
    try:
        while not finished and (most is None or len(minutes) < most):
            finished = search.explore(1)
            minutes.append(plant.time / 60.0)
    except MobeeError as error:
        reason = str(error)
    found = outcome(search.roadmap, search.repairs)
    found |= {"finished": finished, "why": reason, "minutes": np.array(minutes), "deepest": depth.deepest, "pair": depth.pair}
    return found | {"agree": agreement(search.roadmap, seed + 1000)}


def outcome(roadmap: AdaptiveRoadmap, repairs: int) -> dict[str, Any]:
    """Return a roadmap with V vertices and at most A edges from each, and its observations, as a dict of arrays.

    "samples" (V, 7) rad: poses of the vertices.  "goals" (V, A): goal of each edge, -1 for no edge.  "tried" (V, A): number of tries.
    "feasible" (V, A): whether the last try ended at the goal.  "repairs": number of paths that a planner (RRT-Connect) has added to the
    map.
    """
    beliefs, space = roadmap.beliefs, roadmap.space
    return {"samples": space.samples, "goals": space.goals, "tried": beliefs.tried, "feasible": roadmap.feasible, "repairs": repairs}


def agreement(roadmap: AdaptiveRoadmap, seed: int) -> Array:
    """Try each tried edge once more from rest at its vertex, on a new offline plant, and return which results are the same as before.

    The array (E,) has a value for each of the E tried edges, sorted by the number of the start vertex, then by the number of the edge.  It
    is True if both this try and the last one of the exploration reached the goal, or both did not.  `seed`: of the encoder noise.
    """
    plant, space = offline_plant(seed), roadmap.space
    same = []
    for state, action in np.argwhere(roadmap.beliefs.tried > 0).tolist():
        whole = plant.robot.home.copy()
        whole[plant.robot.parts[PART].slice] = space.target(state)
        place(plant, whole)
        goal = space.goal(state, action)
        off = np.abs(plant.act(PART, space.target(goal)).q[space.columns] - space.samples[goal]).max()
        same.append((off <= NEAR) == roadmap.beliefs.last[state, action])
    return np.array(same, dtype=bool)


def perform(service: Service, folder: Path) -> None:
    """Explore the roadmap of the job in `folder` on the live robot, until it is finished or the tries have reached the job's limit.

    Observations are stored at once, so a stopped exploration can be continued.
    """
    job = read(folder / JOB)
    with MapStore(job["store"], PART) as store:
        plant = BusPlant(service, robot(), (PART,))
        search = explorer(plant, job["seed"], store)
        service.ready()
        plant.measure(PART)
        finished, most = False, job["most"]
        while not finished and (most is None or search.record.transitions < most):
            try:
                finished = search.explore(1)
            except ActionInterrupted:
                continue
        write(folder / DONE, {"finished": finished, "repairs": search.repairs})
        plant.leave()


QUICK = 30  # edges
STORE, MAX_SECONDS = "map.sqlite", 8 * 3600.0  # of the live run; s of robot time
PERFORM = "experiments.claims.ch3_roadmaps.roadmap_from_scratch:perform"
MIN_AGREEMENT = 0.95  # share of edges
ABOUT_90, OFTEN = (60.0, 120.0), 0.5  # minutes; share of maps
STYLES = {"feasible": ("tab:blue", 1.6), "failed": ("tab:red", 0.7), "not tried": ("0.75", 0.6)}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option --live, for the live run, to the parser."""
    parser.add_argument("--live", action="store_true", help="also explore the first seed's map by the real processes, in lockstep")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the only condition of the sweep: the exploration of a roadmap for each seed.  With --quick: at most 30 edges."""
    return [Condition("quick-map" if arguments.quick else "map", {"most": QUICK if arguments.quick else None})]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore the roadmap of this seed offline, and return the map and its measures, as in `explored`.

    `settings`: "most", the largest number of tries; None: no limit.
    """
    return explored(seed, settings["most"])


def explore_live(folder: Path, seed: int, most: int | None) -> None:
    """Explore the roadmap of a seed on the live robot, or continue an exploration that was stopped.

    `folder`: gets the file of observations, and a subfolder with the recording of each start of the live system.  `most`: largest number of
    tries; None: no limit.  Nothing is done if the exploration is finished.
    """
    folder.mkdir(exist_ok=True)
    if (folder / DONE).exists():
        return
    number = len(list(folder.glob("launch-*")))
    place = folder / f"launch-{number:03}"
    place.mkdir()
    write(place / JOB, {"seed": seed, "most": most, "store": str((folder / STORE).resolve())})
    summary = launch(place, PERFORM, title="Roadmap from scratch", world=str(TABLE), seed=seed, rate=RATE, speed=SPEED, seconds=MAX_SECONDS)
    done = {**read(place / DONE), "seed": seed, "repeatable": summary["lockstep"]["repeatable"]}
    write(folder / DONE, done | _touched(sorted(folder.glob("launch-*"))))


def _touched(launches: Sequence[Path]) -> dict[str, Any]:
    """Return the duration and the solid contacts of the launches (starts of the live system) from their recordings of every tick.

    Keys: "hours", robot time; "touches", number of solid contacts; "deepest", depth of the deepest one [m], 0 without contacts; "pair", the
    names of its two shapes.
    """
    row = 8 * len(robot().motors)
    ticks = sum((place / POSITIONS).stat().st_size // row for place in launches if (place / POSITIONS).exists())
    touches = [touch for place in launches if (place / CONTACTS).exists() for touch in read_touches(place / CONTACTS, 1.0 / RATE)]
    worst = max(touches, key=lambda touch: touch.depth, default=None)
    deepest, pair = (0.0, "") if worst is None else (worst.depth, worst.pair)
    return {"hours": ticks / RATE / 3600.0, "touches": len(touches), "deepest": deepest, "pair": pair}


def read_live(folder: Path) -> dict[str, Any] | None:
    """Return the roadmap and the measures of the live exploration in `folder`; None if it is not finished.

    Keys: those of `outcome`; "finished", whether all reachable edges were tried; "hours", robot time; "touches", number of solid contacts;
    "deepest", depth [m] of the deepest one, and "pair", the names of its shapes; "agree" (E,), for each tried edge whether another try on
    the offline plant had the same result; "edges", number of tried edges.
    """
    if not (folder / DONE).exists():
        return None
    done = read(folder / DONE)
    with MapStore(folder / STORE, PART) as store:
        search = explorer(offline_plant(done["seed"]), done["seed"], store)
    found = outcome(search.roadmap, done["repairs"]) | {name: done[name] for name in ("finished", "hours", "touches", "deepest", "pair")}
    return found | {"agree": agreement(search.roadmap, done["seed"] + 1000), "edges": int(np.sum(search.roadmap.beliefs.tried > 0))}


def unreached(values: Mapping[str, Any]) -> int:
    """Return how many of the random samples of a roadmap were never reached.  `values`: the result of `explored` or `read_live`."""
    goals, feasible = values["goals"], values["feasible"]
    reached = np.zeros(len(goals), dtype=bool)
    reached[goals[feasible]] = True
    reached[np.flatnonzero((values["tried"] > 0).any(axis=1))] = True
    return int((~reached[:SAMPLES]).sum())


def findings(found: Cells, live: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the results of the explorations: one offline for each seed, and the live one.

    Keys: "maps", a dict from "seed N" or "live" to the measures of this roadmap, as a dict; "claims", a list with the judged claims, as
    dicts (`Claim.record`).  The measures are "finished", whether all reachable edges were tried; "minutes" of robot time; the numbers of
    "edges", of "tried" and of "feasible" edges; the number of random poses that were never reached ("samples_not_come_to"); "repairs", the
    number of paths that a planner has added to the map; "agree", the share of the tried edges that had the same result in another try
    (None without tried edges); and the depth of the deepest solid contact ("deepest_mm").  `live`: the result of `read_live`; None:
    not explored live.
    """
    results = sorted(found.values(), key=lambda result: result.cell.seed)
    rows = {f"seed {result.cell.seed}": _row(result.values) for result in results}
    if live is not None:
        rows["live"] = _row({**live, "minutes": [60.0 * live["hours"]]})
    every = [result.values for result in results]
    done = [values for values in every if values["finished"]]
    return {"maps": rows, "claims": judged(CLAIMS, Explored(every, done, live), bool(done))}


@dataclass(frozen=True)
class Explored:
    """The explored maps, from which the claims are judged.

    `maps`: results of `explored` for all seeds.  `done`: those in which all reachable edges were tried.  `live`: the result of `read_live`,
    or None.
    """

    maps: list[dict[str, Any]]
    done: list[dict[str, Any]]
    live: Mapping[str, Any] | None


def _row(values: Mapping[str, Any]) -> dict[str, Any]:
    tried = int((values["tried"] > 0).sum())
    return {
        "finished": bool(values["finished"]),
        "minutes": round(float(values["minutes"][-1]), 1) if len(values["minutes"]) else 0.0,
        "edges": int((values["goals"] >= 0).sum()),
        "tried": tried,
        "feasible": int(values["feasible"].sum()),
        "samples_not_come_to": unreached(values),
        "repairs": int(values["repairs"]),
        "agree": round(float(np.mean(values["agree"])), 3) if len(values["agree"]) else None,
        "deepest_mm": round(1e3 * float(values["deepest"]), 2),
    }


@claim(
    "thesis 4.3.1, fig. 4.6",
    "exploration at 10 % speed until the feasible sub-graph is known takes about 90 minutes (60 to 120)",
    "about 90 minutes",
    untested="the poses and edges of the published map",
)
def known(found: Explored) -> Measured:
    minutes = [float(values["minutes"][-1]) for values in found.done]
    share = estimate([float(values["feasible"].sum() / (values["tried"] > 0).sum()) for values in found.done])
    text = f"{estimate(minutes, 0)} minutes; {share} of the edges tried are feasible"
    text += f"; live {60.0 * found.live['hours']:.0f} minutes" if found.live else ""
    return text, decides(interval(minutes), *ABOUT_90) if len(found.done) == len(found.maps) else False


@claim("thesis 4.3.1", "small, randomly generated graphs often (more than half of them) contain unreachable vertices", "often")
def gaps(found: Explored) -> Measured:
    with_gaps = sum(unreached(values) > 0 for values in found.done)
    text = f"{with_gaps} of {len(found.done)} maps of seven joints"
    return text, decides(share_interval(with_gaps, len(found.done)), least=OFTEN)


@claim("thesis 4.3.1", "rollback works robustly: at least 0.95 of the edges have the same outcome when tried again from rest", "-")
def repeatable(found: Explored) -> Measured:
    agree = [float(np.mean(values["agree"])) for values in found.done]
    return within(agree, 3, least=MIN_AGREEMENT, text="{} of the edges")


@claim(OUR_AIM, "no listed solid contact of PyBullet deeper than 2 mm while the map is explored live", "0")
def harmless(found: Explored) -> Measured:
    deepest, live = max(1e3 * float(values["deepest"]) for values in found.maps), found.live
    offline = f"offline, by the model, {deepest:.1f} mm"
    if live is None:
        return f"not run live; {offline}", None
    text = f"live {1e3 * live['deepest']:.1f} mm in {live['hours']:.1f} h and {live['touches']} touches; {offline}"
    return f"{text} (1 live run, too few for a verdict)", None if live["deepest"] <= MAX_DEPTH else False


CLAIMS = (known, gaps, repeatable, harmless)


def plot(found: Cells, live: Mapping[str, Any] | None = None) -> Any:
    """Return a figure with three panels: the roadmap before exploration, the explored map, and the number of motions along edges over time.

    `live`: the live exploration, whose map is then drawn; None: the map of the first seed is drawn.
    """
    results = sorted(found.values(), key=lambda result: result.cell.seed)
    drawing = new_figure(15.0, 4.8)
    before, after, course = drawing.subplots(1, 3)
    values = results[0].values if live is None else live
    places = _places(values["samples"])
    exists = values["goals"] >= 0
    _edges(before, values, exists & (np.arange(len(exists)) < SAMPLES)[:, None] & (values["goals"] < SAMPLES), places, "0.4", 0.8)
    before.set_title(f"{SAMPLES} random poses, not verified")
    kinds = {
        "not tried": exists & (values["tried"] == 0),
        "failed": (values["tried"] > 0) & ~values["feasible"],
        "feasible": values["feasible"],
    }
    for kind, which in kinds.items():
        _edges(after, values, which, places, *STYLES[kind], label=f"{kind}: {int(which.sum())}")
    after.set_title("explored " + ("offline" if live is None else "live"))
    after.plot(*places[SAMPLES:].T, "o", color="tab:orange", markersize=3, zorder=3, label="joined by single queries")
    after.legend(fontsize=7, loc="upper left")
    for axes in (before, after):
        axes.plot(*places[:SAMPLES].T, "o", color="black", markersize=4, zorder=3)
        axes.set(xlabel="palm, y [m]", ylabel="palm, z [m]", aspect="equal")
    for result in results:
        minutes = result.values["minutes"]
        course.plot(minutes, np.arange(1, len(minutes) + 1), linewidth=1.0, label=f"seed {result.cell.seed}")
    if live is not None:
        course.plot([60.0 * live["hours"]], [live["edges"]], "k*", markersize=10, label="live (edges known at the end)")
    course.axvline(90.0, color="0.5", linestyle="--", linewidth=0.8)
    course.set(xlabel="robot time [min] (dashed: thesis)", ylabel="motions along edges", xlim=(0.0, None), ylim=(0.0, None))
    course.grid(alpha=0.2)
    course.legend(fontsize=7)
    return drawing


def _places(samples: Array) -> Array:
    """Return the coordinates y and z of the palm in V poses, (V, 2) m, root frame.

    `samples`: the poses, as positions of the moving joints.
    """
    whole = np.repeat(robot().home[None], len(samples), axis=0)
    whole[:, [robot().motor_index(joint) for joint in joints()]] = samples
    places: Array = Model(robot()).evaluate(whole).position(MARKER)[:, 1:]
    return places


def _edges(axes: Any, values: Mapping[str, Any], which: Array, places: Array, color: str, width: float, label: str = "") -> None:
    from matplotlib.collections import LineCollection

    states, actions = np.nonzero(which)
    lines = np.stack([places[states], places[values["goals"][states, actions]]], axis=1)
    axes.add_collection(LineCollection(list(lines), colors=color, linewidths=width, label=label))
    axes.autoscale_view()


SWEEP = Sweep(conditions, trial, findings, plot, add_options=add_options, require=require_ompl)


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Explore the roadmaps that are not in `folder` yet; with --live also the first seed's map on the live robot.

    Returns a dict with the keys "maps" and "claims"; see `results`.
    """
    SWEEP.run(arguments, folder)
    if arguments.live:
        explore_live(folder / "live", arguments.seed, QUICK if arguments.quick else None)
    return results(folder)


def results(folder: Path) -> dict[str, Any]:
    """Compute the results of the finished explorations in `folder`, with the live one if there is one, as `findings` returns them.

    Keys: "maps", a dict from the name of a roadmap ("seed N" or "live") to a dict of its measures; "claims", a list with the judged claims,
    as dicts (`Claim.record`).
    """
    return findings(load_cells(folder), read_live(folder / "live"))


def figure(folder: Path) -> Path:
    """Draw the roadmaps of the run in `folder` to a file.  Returns its path; raises InvalidValue if there is no map."""
    found = load_cells(folder)
    if not found:
        raise InvalidValue(f"{folder} has no finished cells: the run was stopped before the first.")
    return saved(plot(found, read_live(folder / "live")), folder, 110)


EXPERIMENT = Experiment(
    claim="the robot explores an unverified map until its feasible part is known, without harmful contacts",
    source="thesis 4.3.1, fig. 4.6",
    method=Steps(SWEEP.add_arguments, run, figure, results, (*CELL_FILES, f"live/{DONE}", f"live/{STORE}")),
    claims=CLAIMS,
)
