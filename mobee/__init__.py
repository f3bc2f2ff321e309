# SPDX-License-Identifier: Apache-2.0
"""A humanoid that learns by curiosity to plan and to reach, while a reactive layer keeps it safe."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mobee.control import Command, Controller, Forces, Gains, Reacher, ReachPath, Term, constraint_forces, reach_path
    from mobee.derivation import Derived, derive
    from mobee.errors import ActionInterrupted, BatchInterrupted, InvalidValue, MobeeError, RobotFileError, UnknownName
    from mobee.learning.agent import CuriousAgent, run
    from mobee.learning.lattice import Lattice
    from mobee.learning.learner import CuriousSettings
    from mobee.learning.object_space import Grid, ObjectSpace
    from mobee.learning.planner import Plan, Planner
    from mobee.learning.reaching.learner import ReachSettings
    from mobee.learning.reaching.reach_agent import ReachAgent
    from mobee.learning.space import Space, Voronoi
    from mobee.learning.transitions import TransitionModel
    from mobee.learning.value_iteration import policy_iteration, value_iteration
    from mobee.model import Contact, Geometry, World, WorldObject, box, capsule, cylinder, sphere
    from mobee.model.model import Model
    from mobee.model.pose import Pose
    from mobee.model.world_file import load_world
    from mobee.plant import Outcome, PerceivingPlant, Plant
    from mobee.reach import ReachOutcome, ReachPlant, ReachTarget
    from mobee.roadmap.adaptive.adaptive import AdaptiveRoadmap, roadmap_space
    from mobee.roadmap.adaptive.walker import MapExplorer, Walker
    from mobee.roadmap.building import tasks
    from mobee.roadmap.building.build import RoadmapSettings, build_roadmap
    from mobee.roadmap.building.search_scheduler import SearchSettings
    from mobee.roadmap.evolution.nes import NES
    from mobee.roadmap.evolution.search import Restart, minimize
    from mobee.roadmap.ik import costs
    from mobee.roadmap.ik.solve import IK, solve_ik
    from mobee.roadmap.roadmap import Roadmap, load_roadmap
    from mobee.robot.join import join_robots
    from mobee.robot.load import load_robot
    from mobee.robot.robot import Robot
    from mobee.simulation import MotorParameters, OfflinePlant, PlantSettings, SlidingObject, advance_together, run_batch, run_together

_MODULES = {
    "mobee.control": "Command Controller Forces Gains ReachPath Reacher Term constraint_forces reach_path",
    "mobee.derivation": "Derived derive",
    "mobee.errors": "ActionInterrupted BatchInterrupted InvalidValue MobeeError RobotFileError UnknownName",
    "mobee.learning.agent": "CuriousAgent run",
    "mobee.learning.lattice": "Lattice",
    "mobee.learning.learner": "CuriousSettings",
    "mobee.learning.object_space": "Grid ObjectSpace",
    "mobee.learning.planner": "Plan Planner",
    "mobee.learning.reaching.learner": "ReachSettings",
    "mobee.learning.reaching.reach_agent": "ReachAgent",
    "mobee.learning.space": "Space Voronoi",
    "mobee.learning.transitions": "TransitionModel",
    "mobee.learning.value_iteration": "policy_iteration value_iteration",
    "mobee.model": "Contact Geometry World WorldObject box capsule cylinder sphere",
    "mobee.model.model": "Model",
    "mobee.model.pose": "Pose",
    "mobee.plant": "Outcome PerceivingPlant Plant",
    "mobee.reach": "ReachOutcome ReachPlant ReachTarget",
    "mobee.roadmap.adaptive.adaptive": "AdaptiveRoadmap roadmap_space",
    "mobee.roadmap.adaptive.walker": "MapExplorer Walker",
    "mobee.roadmap.building": "tasks",
    "mobee.roadmap.building.build": "RoadmapSettings build_roadmap",
    "mobee.roadmap.building.search_scheduler": "SearchSettings",
    "mobee.roadmap.evolution.nes": "NES",
    "mobee.roadmap.evolution.search": "Restart minimize",
    "mobee.roadmap.ik": "costs",
    "mobee.roadmap.ik.solve": "IK solve_ik",
    "mobee.roadmap.roadmap": "Roadmap load_roadmap",
    "mobee.robot.join": "join_robots",
    "mobee.robot.load": "load_robot",
    "mobee.model.world_file": "load_world",
    "mobee.robot.robot": "Robot",
    "mobee.simulation": "MotorParameters OfflinePlant PlantSettings SlidingObject advance_together run_batch run_together",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = [
    "ActionInterrupted",
    "AdaptiveRoadmap",
    "BatchInterrupted",
    "Command",
    "Contact",
    "Controller",
    "CuriousAgent",
    "CuriousSettings",
    "Derived",
    "Forces",
    "Gains",
    "Geometry",
    "Grid",
    "IK",
    "InvalidValue",
    "Lattice",
    "MapExplorer",
    "MobeeError",
    "Model",
    "MotorParameters",
    "NES",
    "ObjectSpace",
    "OfflinePlant",
    "Outcome",
    "PerceivingPlant",
    "Plan",
    "Planner",
    "Plant",
    "PlantSettings",
    "Pose",
    "ReachAgent",
    "ReachOutcome",
    "ReachPath",
    "ReachPlant",
    "ReachSettings",
    "ReachTarget",
    "Reacher",
    "Restart",
    "Roadmap",
    "RoadmapSettings",
    "Robot",
    "RobotFileError",
    "SearchSettings",
    "SlidingObject",
    "Space",
    "Term",
    "TransitionModel",
    "UnknownName",
    "Voronoi",
    "Walker",
    "World",
    "WorldObject",
    "advance_together",
    "box",
    "build_roadmap",
    "capsule",
    "constraint_forces",
    "costs",
    "cylinder",
    "derive",
    "join_robots",
    "load_roadmap",
    "load_robot",
    "load_world",
    "minimize",
    "policy_iteration",
    "reach_path",
    "roadmap_space",
    "run",
    "run_batch",
    "run_together",
    "solve_ik",
    "sphere",
    "tasks",
    "value_iteration",
]


def __getattr__(name: str) -> Any:
    """Import the module of a public name at the first use of the name, so that a process loads only the modules that it uses."""
    if name == "__version__":
        from importlib import metadata

        return metadata.version("mobee")
    if name not in _HOME:
        raise AttributeError(f"module 'mobee' has no attribute {name!r}")
    module = importlib.import_module(_HOME[name])
    value = getattr(module, name, None) or importlib.import_module(f"{_HOME[name]}.{name}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
