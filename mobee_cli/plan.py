"""`mobee plan`: a way from anywhere to anywhere, by what an agent of a run has learned."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from mobee.errors import MobeeError, UnknownName
from mobee.learning.goal import target_states
from mobee.learning.planner import DISCOUNT, Plan, Planner
from mobee.learning.record import Learned, load_learned
from mobee.learning.space import Space
from mobee.robot.robot import Robot
from mobee.store import STORE
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, require_none, robot_given, robot_of_run
from services.common.exit_codes import BAD_INPUT

SLACK = 0.01  # rad beyond the limits: poses are given rounded, and encoders are noisy
_NOTES = """A place is the number of a state, or the angles in rad of the joints that the
agent knows (or of all motors of its part), within their limits: the state that
holds this pose.
Plans trust what was observed, over a weak belief that untried actions work
(docs/learning.md)."""

_NAME_IT = " The run does not say where the file of its robot is: name it with --robot FILE."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Run, agent, places."""
    parser.epilog = _NOTES
    parser.add_argument("--run", type=Path, required=True, metavar="RUN", help=f"folder of the run, or its file {STORE}")
    parser.add_argument("--agent", metavar="PART", help="whose plan it is, where the run had several agents")
    parser.add_argument("--to", nargs="+", required=True, metavar="PLACE", help="where to: a state, or angles in rad")
    parser.add_argument("--from", nargs="+", dest="start", metavar="PLACE", help="where from (default: where the agent was last)")
    text = f"0 to 1, a factor a step: the smaller, the more a short path is preferred over a reliable one (default: {DISCOUNT})"
    parser.add_argument("--discount", type=float, default=DISCOUNT, metavar="X", help=text)
    add_robot(parser, "default: that of the run, which knows it if `mobee launch` made it or if it comes with mobee")
    parser.add_argument("--json", action="store_true", help="print as JSON, with the pose of every state")


def run(arguments: argparse.Namespace) -> int:
    """Rebuild, plan, print."""
    file = arguments.run / STORE if arguments.run.is_dir() else arguments.run
    try:
        learned = load_learned(file, arguments.agent, _robot(arguments))
        poses: dict[str, int] = {}
        goal = _state(learned, arguments.to, poses)
        start = learned.state if arguments.start is None else _state(learned, arguments.start, poses)
        plan = Planner(learned.space, learned.model.debiased(), goal, arguments.discount).plan(start)
    except MobeeError as error:
        unknown = isinstance(error, UnknownName) and str(error).startswith("unknown robot") and arguments.robot is None
        raise UserError(f"{error}{_NAME_IT if unknown else ''}", BAD_INPUT) from None
    read = [f"{pose} rad is in state {state}." for pose, state in poses.items()]
    print(json.dumps(_as_json(learned, plan), indent=2) if arguments.json else "\n".join([*read, *_lines(learned, plan)]))
    return 0


def _robot(arguments: argparse.Namespace) -> Robot | None:
    """The robot that is given, or that of the settings of the run; None for the one that comes with mobee under the name on record."""
    arguments.robot = arguments.robot or robot_of_run(arguments.run)
    if arguments.robot is None:
        require_none(arguments, "it is for the robot of --robot FILE")
        return None
    return robot_given(arguments)


def _state(learned: Learned, place: list[str], poses: dict[str, int]) -> int:
    """The state meant by a place; one that is given as a pose is added to `poses`."""
    try:
        numbers = [float(word) for word in place]
    except ValueError:
        raise UserError(f"{' '.join(place)!r} is no place: give the number of a state, or angles in rad", BAD_INPUT) from None
    if len(place) == 1 and place[0].lstrip("+-").isdigit():
        return int(target_states(learned.space, int(place[0]))[0])
    space = learned.space
    state = space.state_of_joints(numbers) if len(numbers) == len(space.joints) else space.state_of(numbers)
    _require_within(learned.space, numbers)
    poses[" ".join(place)] = state
    return state


def _require_within(space: Space, pose: list[float]) -> None:
    motors = space.joints if len(pose) == len(space.joints) else space.robot.part(space.part).motors
    for name, angle in zip(motors, pose, strict=True):
        low, high = space.robot.limits[space.robot.motor_index(name)]
        if not low - SLACK <= angle <= high + SLACK:
            hint = " Of several states give one." if all(number.is_integer() and number >= 0 for number in pose) else ""
            raise UserError(f"{name} cannot be at {angle:g} rad: valid is {low:.3g} to {high:.3g}.{hint}", BAD_INPUT)


def _lines(learned: Learned, plan: Plan) -> list[str]:
    known = f"{learned.part}, by {learned.transitions} transitions"
    if not plan.actions:
        return [f"{known}: state {plan.path[0]} is the goal already."]
    steps = "1 action" if len(plan.actions) == 1 else f"{len(plan.actions)} actions"
    lines = [f"{known}: from state {plan.path[0]} to {plan.path[-1]} by {steps}, all as expected with probability {plan.success:.2f}."]
    for state, action, following, chance in zip(plan.path, plan.actions, plan.path[1:], plan.probabilities, strict=False):
        goal, tries = learned.space.goal(state, action), int(learned.model.tries[state, action])
        aimed = "" if goal == following else f" by aiming at {goal}"
        lines.append(f"  {state:>4} -> {following:<4} probability {chance:.2f}, tried {_times(tries)}{aimed}")
    lines.append(f"Planning anew after each action, {plan.steps:.1f} actions on average.")
    if plan.distrusted or plan.avoided:
        lines.append(f"If every action worked, {plan.shortest} would do. Expected to fail (probability of success):")
        lines += [f"  {state:>4} -> {goal:<4} {chance:.2f}" for (state, goal), chance in plan.distrusted.items()]
    if plan.avoided:
        avoided = ", ".join(f"{state} ({chance:.2f})" for state, chance in plan.avoided.items())
        lines.append(f"Avoided (probability of getting through): {avoided}.")
    return lines


def _times(count: int) -> str:
    return {0: "never", 1: "once", 2: "twice"}.get(count, f"{count} times")


def _as_json(learned: Learned, plan: Plan) -> dict[str, Any]:
    space = learned.space
    return {
        "agent": learned.part,
        "transitions": learned.transitions,
        "joints": list(space.joints),
        "path": list(plan.path),
        "goals": [space.goal(state, action) for state, action in zip(plan.path, plan.actions, strict=False)],
        "poses": space.samples[list(plan.path)].tolist(),
        "probabilities": list(plan.probabilities),
        "success": plan.success,
        "mean_actions": plan.steps,
        "shortest": plan.shortest,
        "avoided": [{"state": state, "probability": chance} for state, chance in plan.avoided.items()],
        "distrusted": [{"state": s, "goal": goal, "probability": chance} for (s, goal), chance in plan.distrusted.items()],
    }
