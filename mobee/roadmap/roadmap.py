# SPDX-License-Identifier: Apache-2.0
"""A roadmap: poses that satisfy a task, and the motions between them (thesis chapter 3)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints, real_array
from mobee.errors import InvalidValue, MobeeError
from mobee.model.model import Model
from mobee.roadmap.archive import read, robot_digest, world_as_json, world_digest, world_from_json, write
from mobee.roadmap.graph import Graph, free_path, graph
from mobee.roadmap.ik.problem import chosen
from mobee.robot.load import load_robot, shipped_robots
from mobee.robot.robot import Robot

MAX_GOAL_DISTANCE = 1.5  # spacings: a goal further from all vertices is outside the map


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Roadmap:
    """A graph of poses that satisfy a task.

    Attributes:
        model: robot and world of the roadmap.
        q: (V, n) rad, the poses of all motors.
        y: (V, m) task coordinates of the poses, in their units.
        edges: (E, 2) indices of the two poses that each edge joins, sorted, the lower index first.
        spacing: (m,) distance between vertices in each task coordinate.
        settings: the settings of the builder as plain JSON values; "motors" are the names of the motors that may move, "names" those of the
            task coordinates, if they are known.
        graph: the same edges with their lengths, for the search of paths.
    """

    model: Model  # robot and world it belongs to
    q: Array
    y: Array
    edges: Ints
    spacing: Array
    settings: dict[str, Any]
    graph: Graph = field(init=False)

    def __post_init__(self) -> None:
        """Check that the arrays fit together and are finite, and make `graph`; raise InvalidValue otherwise."""
        n, m = len(self.model.robot.motors), len(self.spacing)
        if self.q.shape != (len(self.q), n) or self.y.shape != (len(self.q), m) or self.edges.shape != (len(self.edges), 2):
            shapes = f"q {self.q.shape}, y {self.y.shape}, edges {self.edges.shape}"
            raise InvalidValue(f"a roadmap of {shapes}; it must be q (V, {n}), y (V, {m}) and edges (E, 2).")
        for name, values in (("q", self.q), ("y", self.y)):
            if not np.isfinite(values).all():
                vertex = int(np.argwhere(~np.isfinite(values))[0, 0])
                raise InvalidValue(f"{name} of vertex {vertex} has numbers that are not finite; all must be.")
        if not (np.isfinite(self.spacing).all() and (self.spacing > 0.0).all()):
            raise InvalidValue(f"spacing is {self.spacing.tolist()}; all numbers must be finite and above 0.")
        if len(self.edges) and not (0 <= self.edges.min() and self.edges.max() < len(self.q)):
            raise InvalidValue(f"edges name the vertices {self.edges.min()} to {self.edges.max()}; valid are 0 to {len(self.q) - 1}.")
        if not (self.edges[:, 0] < self.edges[:, 1]).all():
            raise InvalidValue("the lower vertex of an edge must come first; one edge serves both directions.")
        object.__setattr__(self, "graph", graph(self.q, self.edges))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the task coordinates."""
        return tuple(self.settings.get("names") or (f"y{k + 1}" for k in range(len(self.spacing))))

    @property
    def motors(self) -> tuple[str, ...]:
        """Names of the motors that may move; the others have the same position in every pose."""
        known = self.settings.get("motors")
        return self.model.robot.motors if known is None else tuple(known)

    def entry(self, q_from: ArrayLike) -> int:
        """Return the vertex nearest to the posture `q_from` (n,) rad: Euclidean distance over `motors`, each divided by its range."""
        return int(self._from(q_from).argmin())

    def exit(self, y_goal: ArrayLike) -> int:
        """Return the vertex nearest to the task coordinates `y_goal`, shape (m,).

        Each coordinate is divided by its spacing, the distance of neighbouring vertices along it, before distances are computed. Raises
        InvalidValue if no vertex is within MAX_GOAL_DISTANCE (1.5 spacings).
        """
        return int(self._to(y_goal).argmin())

    def vertex_path(self, q_from: ArrayLike, y_goal: ArrayLike, free: bool = False) -> list[int]:
        """Return the numbers of the vertices on the shortest path from `q_from` (n,) rad to the vertex nearest to `y_goal` (m,).

        `free`: return only a path without contacts in the present world. Raises InvalidValue if the roadmap is empty, if no vertex is
        within 1.5 spacings of the goal, or if an argument is not valid; MobeeError if start and goal are in unconnected parts of the map,
        or if every path has contacts.
        """
        if free:
            return free_path(self.model, self.graph, self.edges, self._posture(q_from), self._from(q_from), self._to(y_goal))
        start, goal = self.entry(q_from), self.exit(y_goal)
        vertices = self.graph.shortest(start, goal)
        if vertices is None:
            raise MobeeError(self._apart(start, goal))
        return vertices

    def path(self, q_from: ArrayLike, y_goal: ArrayLike, free: bool = False) -> Array:
        """Return the shortest path through the roadmap from a posture to the vertex nearest to a goal, as poses (K, n) rad.

        Straight lines join the poses; the first line, from q_from to the nearest vertex, is not an edge of the map.

        Args:
            q_from: (n,) rad, the start.
            y_goal: (m,), the goal in the units of the task coordinates.
            free: return only a path without contacts in the present world.  Edges are checked when a path needs them.  If the first line or
                the last pose has contacts, other vertices are tried: the 24 nearest to the start, and the 8 nearest to the goal, if they
                are within 1.5 spacings of it.

        Raises:
            InvalidValue: the map is empty; an argument has a wrong shape or is not finite; or no vertex is within 1.5 spacings of the goal
                (the distance in task coordinates, each divided by its `spacing`).
            MobeeError: start and goal are in unconnected parts of the map, or every path has contacts.
        """
        start = self._posture(q_from)
        poses = self.q[self.vertex_path(start, y_goal, free)]
        return poses if np.array_equal(start, poses[0]) else np.concatenate([start[None], poses])

    def __repr__(self) -> str:
        """Return a description in one line: numbers of poses and edges, the robot, and the task coordinates."""
        return f"Roadmap({len(self.q)} poses, {len(self.edges)} edges, {self.model.robot.name!r}: {', '.join(self.names)})"

    def save(self, path: str | Path) -> None:
        """Write the roadmap to a .npz file, completely or not at all; raise MobeeError if the file cannot be written."""
        model = self.model
        write(
            path,
            {"q": self.q, "y": self.y, "edges": self.edges, "spacing": self.spacing},
            {"settings": self.settings | digests(model), "world": world_as_json(model.world)},
        )

    def format_coordinates(self, y: Array) -> str:
        """Return task coordinates y (m,) as text, each with its name."""
        return ", ".join(f"{name} {_short(value)}" for name, value in zip(self.names, y, strict=True))

    def _posture(self, given: ArrayLike) -> Array:
        q, n = real_array("q_from", given), len(self.model.robot.motors)
        if q.shape != (n,) or not np.isfinite(q).all():
            raise InvalidValue(f"q_from has shape {q.shape}; it must be ({n},) rad, finite, a position for every motor.")
        self._require_vertices()
        return q

    def _from(self, q_from: ArrayLike) -> Array:
        """Return the distance (V,) of every vertex from the posture `q_from` (n,) rad: a Euclidean distance without a unit, see `entry`."""
        start = self._posture(q_from)
        free = chosen(self.model.robot, self.motors)
        low, high = self.model.robot.limits[free].T
        apart: Array = np.linalg.norm((self.q[:, free] - start[free]) / (high - low), axis=1)
        return apart

    def _to(self, y_goal: ArrayLike) -> Array:
        """Return the distance of every vertex from the task coordinates y_goal (m,); (V,), infinite where it is above MAX_GOAL_DISTANCE.

        Each coordinate is divided by its spacing, the distance of neighbouring vertices along it: the distances are in spacings. Raises
        InvalidValue if y_goal has another shape or is not finite, or if no vertex is within MAX_GOAL_DISTANCE (1.5 spacings).
        """
        goal, m = np.atleast_1d(real_array("y_goal", y_goal)), len(self.spacing)
        if goal.shape != (m,) or not np.isfinite(goal).all():
            raise InvalidValue(f"y_goal has shape {goal.shape}; it must be ({m},) finite numbers: {', '.join(self.names)}.")
        self._require_vertices()
        apart: Array = np.linalg.norm((self.y - goal) / self.spacing, axis=1)
        nearest = int(apart.argmin())
        if apart[nearest] > MAX_GOAL_DISTANCE:
            raise InvalidValue(
                f"the map has no vertex near {self.format_coordinates(goal)}: the nearest vertex, {apart[nearest]:.1f} spacings away, "
                f"is at {self.format_coordinates(self.y[nearest])}; choose a goal within {MAX_GOAL_DISTANCE:g} spacings of a vertex."
            )
        return np.where(apart > MAX_GOAL_DISTANCE, np.inf, apart)

    def _require_vertices(self) -> None:
        if not len(self.q):
            raise InvalidValue("the map is empty: no pose met its costs. Build it with a wider box, or with looser tolerances.")

    def _apart(self, start: int, goal: int) -> str:
        label = self.graph.components
        mine, other = (int((label == label[one]).sum()) for one in (start, goal))
        return (
            f"no path leads from vertex {start} ({self.format_coordinates(self.y[start])}) to vertex {goal} "
            f"({self.format_coordinates(self.y[goal])}): the map has {label.max() + 1} unconnected parts, and the two vertices are "
            f"in parts of {mine} and {other} vertices. Start elsewhere, or build the map with more neighbours or a larger `longest`."
        )


def load_roadmap(path: str | Path, model: Model | None = None, robot: Robot | None = None) -> Roadmap:
    """Load a roadmap from a file.

    Args:
        path: of the .npz file.
        model: robot and world, which must be those of the roadmap; None: the world is read from the file, and the robot is `robot`.
        robot: the robot of the roadmap, if `model` is None; None: the shipped robot with the name in the file.

    Raises:
        MobeeError: the file is not a complete roadmap, or belongs to another robot or world; the message has the digests of both.
    """
    arrays, notes = read(path)
    try:
        settings, made_in = dict(notes["settings"]), notes["world"]
        q, y, spacing = (arrays[name].astype(np.float64, casting="same_kind") for name in ("q", "y", "spacing"))
        edges = arrays["edges"].astype(np.intp, casting="same_kind")
        here = _rebuilt(path, settings, made_in, robot) if model is None else model
        _require_same(path, settings, here)
        return Roadmap(here, q, y, edges, spacing, settings)
    except (KeyError, TypeError) as error:
        raise MobeeError(
            f"{path}: no roadmap, or only a part of one ({error}). Give another file, or remove it and build it anew."
        ) from error
    except InvalidValue as error:
        raise MobeeError(f"{path}: damaged: {error}") from error


def digests(model: Model) -> dict[str, str]:
    """Return the settings that identify a roadmap's robot and world, as a dict of texts.

    Keys: "robot", the name of the robot; "robot_digest" and "world_digest", hex digits that change if robot or world change.
    """
    return {
        "robot": model.robot.name,
        "robot_digest": robot_digest(model.robot),
        "world_digest": world_digest(model.world),
    }


def _rebuilt(path: str | Path, settings: dict[str, Any], made_in: list[dict[str, Any]], robot: Robot | None) -> Model:
    name = settings["robot"]
    if robot is None and name not in shipped_robots():
        raise MobeeError(
            f"{path}: made for the robot {name!r}, which does not come with mobee: name its file, as robot=load_robot(FILE), or on the "
            "command line as --robot FILE."
        )
    return Model(load_robot(name) if robot is None else robot, world_from_json(made_in))


def _require_same(path: str | Path, settings: dict[str, Any], model: Model) -> None:
    here = digests(model)
    for what in ("robot", "world"):
        made, now = settings[f"{what}_digest"], here[f"{what}_digest"]
        if made != now:
            raise MobeeError(
                f"{path}: made for {what} {made}, and this {what} is {now}: not every pose and edge of it need be free here. "
                f"Build it anew, or load it with the {what} it was made for."
            )


def _short(value: float) -> str:
    """Format a number with at most four decimals, without trailing zeros."""
    return f"{round(float(value), 4) + 0.0:.4f}".rstrip("0").rstrip(".")
