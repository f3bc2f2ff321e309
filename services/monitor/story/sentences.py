# SPDX-License-Identifier: Apache-2.0
"""Builds the sentences of an agent's story: its action, its expectation, the outcome, and its plan."""

from __future__ import annotations

from collections.abc import Sequence

from bus_schema.messages import Decision, Playback, Reach, Transition
from mobee.arrays import Array
from mobee.learning.space import Space
from mobee.learning.value_iteration import LEAST_PROBABILITY, surprise_of
from services.monitor.story.words import action_words, displacement, listed, ordinal, percent, title_of

UNSURE = 0.05  # an outcome that is likelier than the goal by less is not expected
STRATEGIES = {
    "curious": "by curiosity",
    "random": "at random",
    "least_tried": "by what was tried least",
    "nearest_untried": "by the shortest path to an untried action",
    "count_bonus": "by a bonus for rarely tried actions",
    "posterior_sampling": "by curiosity under a drawn model",
    "depleting": "by curiosity that plans for what will be left",
}
WITHOUT_PLAN = {"random": "it chooses at random", "least_tried": "it chooses what it tried least from where it is"}


def tries_sentence(decision: Decision, space: Space, places: Array | None) -> str:
    """Describe the present action, such as "elbow +32°: its hand goes 12 cm up. 4th try from here.".

    `places`: position of the hand in each state, (S, 3) m; None: the motion of the hand is not described.
    """
    shift = "" if places is None else displacement(places[decision.goal] - places[decision.s], space.robot.name)
    return f"{action_words(space, decision.s, decision.goal)}{f': {shift}' if shift else ''}. {ordinal(decision.tries + 1)} try from here."


def expects_sentence(decision: Decision) -> str:
    """Describe the outcome that the agent expects of the present action, with its probability."""
    if decision.tries == 0:
        return f"It cannot know what will happen; it gives getting there {percent(decision.reached)}."
    if decision.expected == decision.goal:
        return f"It expects to get there ({percent(decision.reached)})."
    if decision.probability - decision.reached < UNSURE:
        return f"It is not sure what will happen; it gives getting there {percent(decision.reached)}."
    where = "to stay where it is" if decision.expected == decision.s else "to end in another pose"
    return f"It expects {where} ({percent(decision.probability)}), not to get there ({percent(decision.reached)})."


def outcome_sentence(seen: Transition) -> str:
    """Describe the outcome of an action, such as "It got there." or "It ended against the table, not where it wanted."."""
    touched = listed([f"the {name}" for name in seen.touched[:2]]) if seen.touched else ""
    against = f" against {touched}" if touched else ""
    rest = "" if seen.settled else ", still moving when its time was over"
    if seen.s_next == seen.goal:
        return f"It got there{f', and touches {touched}' if touched else ''}{rest}."
    if seen.s_next == seen.s:
        return f"It did not get out of its pose{f': it ended{against}' if against else ''}{rest}."
    return f"It ended{against or ' in another pose'}, not where it wanted{rest}."


def surprise_sentence(seen: Transition) -> str:
    """Describe how much a transition surprised the agent, and how much the agent learned from it, both in nats."""
    if seen.probability < LEAST_PROBABILITY:
        return f"It had never seen that: surprise over {surprise_of(0.0):.1f} nats, learned {seen.reward:.3f} nats."
    return f"Surprise {surprise_of(seen.probability):.2f} nats, learned {seen.reward:.3f} nats."


def wants_sentence(decision: Decision, untried: Sequence[int], actions: Sequence[int]) -> str:
    """Describe where the agent's plan leads and why.

    `untried`: for each state, how many of its actions were never tried. `actions`: for each state, the number of all its actions. The text
    is empty if the last state of the plan has no entry in `untried`; for explorers (exploration strategies) that do not plan, these
    numbers are not used.
    """
    if decision.explorer in WITHOUT_PLAN:
        return f"nothing in particular: {WITHOUT_PLAN[decision.explorer]}."
    end = decision.plan[-1] if decision.plan else decision.goal
    steps = len(decision.plan)
    if not untried or end >= len(untried):
        return ""
    why = f"{untried[end]} of {actions[end]} actions were never tried" if untried[end] else "it still learns most, though all was tried"
    if steps <= 1:
        return f"to continue from there, where {why}."
    return f"to continue by {steps - 1} more action{'s' if steps > 2 else ''}, to a pose where {why}."


def reach_sentence(reach: Reach) -> str:
    """Describe the state of a reach: its target, its phase, and the remaining distance in mm."""
    target, left = ("the place" if reach.object == "reach_target" else f"the {reach.object}"), f"{1000 * reach.missing:.0f} mm"
    if reach.phase == "reaching":
        return f"Reaches for {target}: {left} to go."
    if reach.phase == "interrupted":
        return f"Its reach for {target} was interrupted."
    if reach.missing < 0.01:
        return f"Has reached {target}: {left} from it."
    return f"Reached for {target} and came to rest {left} from it."


def playback_sentence(seen: Playback) -> str:
    """Describe a motion along a path in a roadmap (graph of poses): the moved marker, goal, phase, and remaining distance in mm."""
    marker, left = f"the {title_of(seen.marker)}", f"{1000 * seen.missing:.0f} mm"
    where = seen.place.replace(f"{seen.marker} ", "")  # coordinates of a roadmap are named by their marker
    if seen.phase == "interrupted":
        return f"The motion of {marker} to {where} was interrupted, {left} from its end."
    if seen.phase == "over":
        return f"Moved {marker} to {where}: it rests {left} from the end of the path."
    if seen.share >= 1.0:
        return f"Moves {marker} to {where}: {left} to go; it comes to rest."
    return f"Moves {marker} to {where}: {left} to go, {percent(seen.share)} of {seen.duration:.1f} s are over."
