# SPDX-License-Identifier: Apache-2.0
"""`mobee plan`: plans a path between states or poses with the model that an agent has learned in a run."""

from __future__ import annotations

import argparse
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from mobee.errors import MobeeError, UnknownName
from mobee.learning.goal import target_states
from mobee.learning.planner import DISCOUNT, Plan, Planner
from mobee.learning.record import Learned, load_learned
from mobee.learning.space import Space
from mobee.robot.robot import Robot
from mobee.store import STORE, store_of
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, require_none, robot_given, robot_of_run
from services.common.exit_codes import BAD_INPUT

SLACK = 0.01  # rad beyond the limits that are accepted: poses may be rounded, and encoders are noisy
_NOTES = """A PLACE is the number of a state, or a pose: the angles in rad of the joints
that the agent moves, or of all motors of its part. A pose stands for its state.
Plans use the observed outcomes, and a weak prior belief that actions which were
never tried succeed (docs/learning.md)."""

UNLIKELY = 0.5  # probability below which a plan is expected to fail
BETTER = 3  # number of goals that are named instead

_NAME_IT = " The run does not record the file of its robot: name it with --robot FILE."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee plan` to the parser: run, agent, goal, start and others."""
    parser.epilog = _NOTES
    parser.add_argument("--run", type=Path, required=True, metavar="RUN", help=f"folder of the run, or its file {STORE}")
    parser.add_argument("--agent", metavar="PART", help="part of the agent, if the run had several agents")
    parser.add_argument("--to", nargs="+", required=True, metavar="PLACE", help="goal: a state, or angles in rad")
    parser.add_argument("--from", nargs="+", dest="start", metavar="PLACE", help="start (default: the last state of the agent)")
    text = f"discount per step, 0 to 1: smaller values prefer short paths to reliable ones (default: {DISCOUNT})"
    parser.add_argument("--discount", type=float, default=DISCOUNT, metavar="X", help=text)
    add_robot(parser, "default: the robot of the run, if `mobee launch` made the run or the robot is a shipped one")
    parser.add_argument("--json", action="store_true", help="print as JSON, with the pose of every state")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee plan`: rebuild the agent's model from its transitions, plan a path, print it, and return the exit code."""
    file = store_of(arguments.run)
    try:
        learned = load_learned(file, arguments.agent, _robot(arguments))
        poses: dict[str, int] = {}
        goal = _state(learned, arguments.to, poses)
        start = learned.state if arguments.start is None else _state(learned, arguments.start, poses)
        plan = Planner(learned.space, learned.model.debiased(), goal, arguments.discount).plan(start)
    except MobeeError as error:
        unknown = isinstance(error, UnknownName) and str(error).startswith("unknown robot") and arguments.robot is None
        raise UserError(f"{error}{_NAME_IT if unknown else ''}", BAD_INPUT) from None
    better = _better(learned, start, plan, arguments.discount)
    read = [f"{pose} rad is in state {state}." for pose, state in poses.items()]
    print(json.dumps(_as_json(learned, plan), indent=2) if arguments.json else "\n".join([*read, *_lines(learned, plan), *better]))
    return 0


def _robot(arguments: argparse.Namespace) -> Robot | None:
    """Return the robot of the options or of the settings of the run; None for the shipped one of the recorded name."""
    arguments.robot = arguments.robot or robot_of_run(arguments.run) or _beside(arguments.run)
    if arguments.robot is None:
        require_none(arguments, "only valid with --robot FILE")
        return None
    return robot_given(arguments)


def _beside(store: Path) -> str | None:
    """Return the robot that `mobee learn` writes beside a file of transitions, under the same name; None if there is none."""
    robot = store.with_suffix(".xml") if store.is_file() else None
    return str(robot) if robot is not None and robot.is_file() else None


def _state(learned: Learned, place: list[str], poses: dict[str, int]) -> int:
    """Return the state that a command-line argument means: a state's number, or a pose, which is then added to `poses`."""
    try:
        numbers = [float(word) for word in place]
    except ValueError:
        raise UserError(f"{' '.join(place)!r} is not valid: give the number of a state, or angles in rad", BAD_INPUT) from None
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
            hint = " Give one state only." if all(number.is_integer() and number >= 0 for number in pose) else ""
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
    lines.append(f"With a new plan after each action, {plan.steps:.1f} actions on average.")
    if plan.distrusted or plan.avoided:
        lines.append(f"If every action succeeded, {plan.shortest} would be enough. Expected to fail (probability of success):")
        lines += [f"  {state:>4} -> {goal:<4} {chance:.2f}" for (state, goal), chance in plan.distrusted.items()]
    if plan.avoided:
        avoided = ", ".join(f"{state} ({chance:.2f})" for state, chance in plan.avoided.items())
        lines.append(f"Avoided states (probability of passing): {avoided}.")
    return lines


def _better(learned: Learned, start: int, plan: Plan, discount: float) -> list[str]:
    """Explain a plan that is expected to fail: name untried actions, and the goals that are reached most reliably from the start."""
    if plan.success >= UNLIKELY:
        return []
    pairs = zip(plan.path, plan.actions, strict=False)
    never = sum(learned.model.tries[state, action] == 0 for state, action in pairs)
    beliefs = learned.model.debiased()
    chances: dict[int, float] = {}
    for goal in sorted(set(range(len(learned.space.samples))) - {start, plan.path[-1]}):
        with suppress(MobeeError):  # no path leads there
            chances[goal] = Planner(learned.space, beliefs, target_states(learned.space, goal), discount).plan(start).success
    best = sorted(chances, key=lambda goal: -chances[goal])[:BETTER]
    tried = f"{never} of its {len(plan.actions)} actions were never tried, so more transitions may find a better one. " if never else ""
    goals = ", ".join(f"{goal} ({chances[goal]:.2f})" for goal in best)
    reliable = f"From here the most reliable goals are {goals}." if best else "From here no other goal can be reached."
    return [f"This plan will probably fail: {tried}{reliable}"]


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
