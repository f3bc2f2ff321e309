# SPDX-License-Identifier: Apache-2.0
"""The sentences of the story, and the numbers behind its pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION
from bus_schema.messages import Decision, EStop, Learned, Playback, Reach, Transition
from mobee import Lattice, TransitionModel, load_robot
from mobee.model.kinematics import link_transforms
from mobee.rendering.palette import colors_of_all
from services.agents.streams import surprises
from services.monitor.status import Seen, banner
from services.monitor.story.knowledge import knowledge_of
from services.monitor.story.places import base_link, places, shown_spot
from services.monitor.story.sentences import (
    expects_sentence,
    outcome_sentence,
    playback_sentence,
    reach_sentence,
    surprise_sentence,
    tries_sentence,
    wants_sentence,
)
from services.monitor.story.teller import Teller
from services.monitor.story.words import displacement, joint_words, listed, ordinal, percent
from tests.services.robots import ARM as OWN

ROBOT = load_robot("icub")
SPACE = Lattice(ROBOT, ["l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"], neighbours="equidistant")
HEADER: dict[str, Any] = {"v": VERSION, "run": "r", "src": "agent_left_arm", "seq": 0, "k": 0, "t": 0, "tw": 0}


def decision(**changes: Any) -> Decision:
    fields = {"agent": "left_arm", "n": 3, "s": 40, "a": 3, "goal": 67, "tries": 3, "reached": 0.8, "expected": 67, "probability": 0.8}
    return Decision(**(HEADER | fields | {"reward": 0.02, "explorer": "curious", "plan": [67]} | changes))


def transition(**changes: Any) -> Transition:
    fields = {"agent": "left_arm", "n": 4, "s": 40, "a": 3, "goal": 67, "s_next": 67, "reward": 0.0321, "value": 0.1, "probability": 0.5}
    return Transition(**(HEADER | fields | {"settled": True, "duration": 2.0, "touched": []} | changes))


def learned(model: TransitionModel, **changes: Any) -> Learned:
    numbers = {"tries": model.tries.astype("<u4").tobytes(), "reward": model.reward.astype("<f4").tobytes()}
    fields = {"agent": "left_arm", "n": 3, "s": 40, "space": json.dumps(model.space.settings), "value": numbers["reward"]}
    return Learned(**(HEADER | numbers | fields | {"surprises": surprises(model)} | changes))


def test_words() -> None:
    assert [ordinal(n) for n in (1, 2, 3, 4, 11, 12, 13, 21, 102, 111)] == "1st 2nd 3rd 4th 11th 12th 13th 21st 102nd 111th".split()
    assert joint_words("l_shoulder_pitch", "left_arm", ROBOT) == "shoulder pitch"
    assert joint_words("torso_yaw", "torso", ROBOT) == "yaw"
    assert joint_words("arm_0", "arm", load_robot("katana")) == "joint 0"
    assert [listed(words) for words in (["a"], ["a", "b"], ["a", "b", "c"])] == ["a", "a and b", "a, b and c"]
    assert [percent(share) for share in (0.0, 0.001, 0.5, 0.999, 1.0)] == ["0 %", "under 1 %", "50 %", "over 99 %", "100 %"]


def test_directions_are_those_of_the_robot_in_front_of_a_person() -> None:
    assert displacement(np.array([-0.1, 0.0, 0.08]), "icub") == "13 cm forward and up"
    assert displacement(np.array([0.0, 0.2, -0.01]), "icub") == "20 cm right"
    assert displacement(np.array([0.001, 0.002, 0.0]), "icub") == ""
    assert displacement(np.array([-0.1, 0.0, -0.08]), "panda") == "13 cm along −x and down"


def test_what_it_tries_is_said_by_joints_and_hand() -> None:
    where = np.zeros((81, 3))
    where[67] = 0.0, 0.0, 0.12
    assert tries_sentence(decision(), SPACE, where) == f"elbow +{elbow():.0f}°: 12 cm up. 4th try from here."
    assert tries_sentence(decision(tries=0, goal=13), SPACE, None) == f"elbow −{elbow():.0f}°. 1st try from here."


def elbow() -> float:
    """A step of the elbow, degrees."""
    return float(np.rad2deg(np.ptp(ROBOT.limits[ROBOT.motor_index("l_elbow")]) / 4.0))


def test_what_it_expects() -> None:
    assert expects_sentence(decision()) == "It expects to get there (80 %)."
    assert expects_sentence(decision(tries=0, reached=0.5)) == "It cannot know what will happen; it gives getting there 50 %."
    assert "not sure" in expects_sentence(decision(expected=5, probability=0.34, reached=0.33))
    stays = decision(expected=40, probability=0.7, reached=0.2)
    assert expects_sentence(stays) == "It expects to stay where it is (70 %), not to get there (20 %)."
    assert "to end in another pose" in expects_sentence(decision(expected=5, reached=0.1))


def test_what_happened() -> None:
    assert outcome_sentence(transition()) == "It got there."
    assert outcome_sentence(transition(touched=["table"])) == "It got there, and touches the table."
    assert outcome_sentence(transition(s_next=3, touched=["table"])) == "It ended against the table, not where it wanted."
    assert outcome_sentence(transition(s_next=3)) == "It ended in another pose, not where it wanted."
    assert outcome_sentence(transition(s_next=40, touched=["table"])) == "It did not get out of its pose: it ended against the table."
    assert outcome_sentence(transition(settled=False)) == "It got there, still moving when its time was over."


def test_how_surprised_it_was() -> None:
    assert surprise_sentence(transition()) == "Surprise 0.69 nats, learned 0.032 nats."
    assert surprise_sentence(transition(probability=0.0)) == "It had never seen that: surprise over 6.9 nats, learned 0.032 nats."


def test_what_it_wants() -> None:
    untried, actions = [0] * 81, [8] * 81
    untried[67] = 5
    assert wants_sentence(decision(), untried, actions) == "to continue from there, where 5 of 8 actions were never tried."
    far = decision(plan=[67, 66, 3])
    assert (
        wants_sentence(far, untried, actions)
        == "to continue by 2 more actions, to a pose where it still learns most, though all was tried."
    )


def test_a_reach_is_said() -> None:
    about = {
        "action_id": "a",
        "marker": "left_palm",
        "object": "ball",
        "end_k": 1,
        "target": [0.0] * 3,
        "q": [0.0] * 16,
        "position": [0.0] * 3,
    }
    reach = Reach(**HEADER, **about, phase="reaching", missing=0.12, settled=False, touched=[])
    assert reach_sentence(reach) == "Reaches for the ball: 120 mm to go."
    over = Reach(**HEADER, **about, phase="over", missing=0.003, settled=True, touched=[])
    assert reach_sentence(over) == "Has reached the ball: 3 mm from it."


def test_what_is_known_and_what_is_left() -> None:
    model = TransitionModel(SPACE)
    for _ in range(9):
        model.observe(40, 3, SPACE.goal(40, 3))
    for outcome in (3, 3, 40):
        model.observe(40, 0, outcome)
    known = knowledge_of(learned(model), SPACE)
    assert known is not None
    assert known.tried == pytest.approx(2 / SPACE.state_actions)
    assert known.predictable == pytest.approx(1 / SPACE.state_actions)  # the other outcome is as likely as one of three
    left = known.left(float(known.reward[known.exists].max()))
    assert left[40] < left[0] <= 1.0
    assert known.untried()[40] == len(SPACE.actions(40)) - 2
    assert knowledge_of(learned(model, tries=b"1234"), SPACE) is None


def test_places_are_those_of_the_hand_and_move_with_the_body(rng: np.random.Generator) -> None:
    spots = {part: shown_spot(ROBOT, part) for part in ROBOT.parts}
    assert {part: spot.name for part, spot in spots.items() if spot} == {
        "torso": "head",
        "head": "left_eye",
        "left_arm": "left_palm",
        "right_arm": "right_palm",
    }
    q = rng.uniform(*ROBOT.limits.T)
    where, base = places(SPACE, spots["left_arm"], ROBOT.home), base_link(ROBOT, "left_arm")
    q[ROBOT.part("left_arm").slice] = SPACE.target(17)
    transforms = link_transforms(ROBOT, q)
    palm = ROBOT.marker("left_palm")
    truly = transforms[palm.link, :3, :3] @ palm.position + transforms[palm.link, :3, 3]
    np.testing.assert_allclose(transforms[base, :3, :3] @ where[17] + transforms[base, :3, 3], truly, atol=1e-9)


def test_a_part_without_markers_is_where_its_last_link_is() -> None:
    spot = shown_spot(load_robot("katana"), "arm")
    assert spot is not None
    assert (spot.name, spot.link) == ("end of the arm", 6)


def test_the_story_of_an_agent_from_its_messages() -> None:
    teller, model = Teller(ROBOT, colors_of_all(ROBOT.parts)), TransitionModel(SPACE)
    teller.note_learned(learned(model, n=0))
    teller.note_decision(decision(tries=0, reached=0.5))
    values = teller.values()
    (card,) = values["cards"]
    assert card["title"] == "left arm" and "1st try from here" in card["now"] and "last" not in card
    assert values["left"]["left_arm"]["path"] == [67, 67] and len(values["places"]["left_arm"]["points"]) == 81
    model.observe(40, 3, 3)
    teller.note_transition(transition(s_next=3, touched=["table"]))
    teller.note_learned(learned(model, n=1, s=3))
    values = teller.values()
    (card,) = values["cards"]
    assert "now" not in card and card["last"]["outcome"] == "It ended against the table, not where it wanted."
    assert [point[0] for point in values["curves"]["left_arm"]] == [0, 1]
    assert teller.values() == {}
    json.dumps(values)


def test_a_decision_that_arrives_before_the_outcome_of_the_one_before_stays() -> None:
    teller = Teller(ROBOT, colors_of_all(ROBOT.parts))
    teller.note_learned(learned(TransitionModel(SPACE), n=0))
    for arrived, shown in ((transition(n=7), False), (decision(n=7), True), (transition(n=7), True), (transition(n=8), False)):
        if isinstance(arrived, Transition):
            teller.note_transition(arrived)
        else:
            teller.note_decision(arrived)
        values = teller.values()
        (card,) = values["cards"]
        assert ("now" in card) == shown
        if not shown and isinstance(arrived, Transition) and arrived.n == 8:
            assert not values["left"]["left_arm"].get("path")


def test_an_agent_of_another_robot_has_a_story_too(tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text(OWN)
    robot = load_robot(tmp_path / "own.xml")
    model = TransitionModel(Lattice(robot, ["pan", "bend"], neighbours=4))
    teller = Teller(robot, colors_of_all(robot.parts))
    teller.note_learned(learned(model, agent="arm", s=0))
    teller.note_learned(learned(model, agent="tail"))  # this robot has no such part
    assert [card["part"] for card in teller.values()["cards"]] == ["arm"]


ALL = ("robot_sim", "model", "controller")
STOP = EStop(**HEADER, set=True, source="robot_sim", reason="emergency stop by page: pressed")


@pytest.mark.parametrize(
    ("seen", "level", "title"),
    [
        (Seen(), "waiting", "Waiting for the robot"),
        (Seen(clock_age=0.0, mode="free", services=ALL, stop=STOP), "stop", "EMERGENCY STOP"),
        (Seen(clock_age=0.0, mode="free", services=ALL, gates={"left_arm": "fault"}), "fault", "FAULT: left arm"),
        (Seen(clock_age=9.0, mode="paused", services=ALL), "paused", "Paused"),
        (Seen(clock_age=9.0, mode="free", services=ALL), "fault", "The robot does not answer"),
        (Seen(clock_age=0.0, mode="free", services=("robot_sim", "model"), known=ALL), "fault", "The controller is gone"),
        (Seen(clock_age=0.0, mode="free", services=()), "fault", "The robot is gone"),
        (Seen(clock_age=0.0, mode="free", services=ALL, held_for={"torso": 3.0}), "hold", "HOLD: torso"),
        (Seen(clock_age=0.0, mode="free", services=ALL, ended=True), "ended", "The system has ended"),
    ],
)
def test_what_stops_the_robot_is_said_with_what_to_do(seen: Seen, level: str, title: str) -> None:
    said = banner(seen)
    assert said is not None
    assert (said["level"], said["title"]) == (level, title)
    assert said["text"] and said["todo"]


def test_a_scenario_without_model_and_controller_is_well() -> None:
    assert banner(Seen(clock_age=0.0, mode="free", services=("robot_sim", "port_filter"), known=("robot_sim", "port_filter"))) is None


def test_nothing_is_said_when_all_is_well_also_if_a_part_holds_for_a_moment() -> None:
    assert banner(Seen(clock_age=0.0, mode="free", services=ALL, held_for={"torso": 0.2}, gates={"torso": "hold"})) is None


def playback(**changes: Any) -> Playback:
    fields = {"phase": "moving", "place": "right_palm x -0.3", "marker": "right_palm", "path": [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]}
    return Playback(**(HEADER | {"src": "player"} | fields | {"share": 0.25, "duration": 4.0, "missing": 0.08} | changes))


def test_a_motion_along_a_roadmap_is_shown_until_the_robot_does_something_else() -> None:
    assert playback_sentence(playback()) == "Moves the right palm to x -0.3: 80 mm to go, 25 % of 4.0 s are over."
    assert playback_sentence(playback(share=1.0, missing=0.004)) == "Moves the right palm to x -0.3: 4 mm to go; it comes to rest."
    teller = Teller(ROBOT, colors_of_all(ROBOT.parts))
    teller.note_playback(playback())
    path = teller.values()["path"]
    assert (path["phase"], path["share"], path["marker"], len(path["points"])) == ("moving", 0.25, "right palm", 2)
    teller.note_gone("someone else")
    assert teller.values() == {}
    teller.note_gone("player")
    assert "was interrupted, 80 mm from its end" in teller.values()["path"]["now"]
    teller.note_playback(playback(phase="over", share=1.0, missing=0.002))
    assert teller.values()["path"]["now"] == "Moved the right palm to x -0.3: it rests 2 mm from the end of the path."
    teller.note_decision(decision())
    assert teller.values()["path"] == {}
