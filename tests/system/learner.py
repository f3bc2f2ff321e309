# SPDX-License-Identifier: Apache-2.0
"""A process that learns until it is killed, and says after each transition what its model is."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from mobee.learning.agent import CuriousAgent
from mobee.learning.tabular import TabularPlant, half_space
from mobee.store import TransitionStore
from tests.mobee.learning.toys import arm


def curious_agent(store: TransitionStore | None) -> CuriousAgent:
    """An agent in a world where some actions are uncertain, which continues from the state of the stored agent."""
    space = arm(neighbours="equidistant")
    plant = TabularPlant(space, *half_space(space), seed=7, start=40)
    agent = CuriousAgent(space, plant, seed=5, store=store, beliefs="debiased")
    plant.actions = agent.transitions
    if agent.last is not None:
        plant.state = agent.last.s_next
    return agent


def digest(agent: CuriousAgent) -> str:
    """Hash of the agent's beliefs and plans."""
    model = agent.model
    known = (model.counts, model.outcomes, model.probabilities, model.reward, model.tries, agent.beliefs.probabilities, *agent.plan())
    return hashlib.sha256(b"".join(array.tobytes() for array in known)).hexdigest()


def learn(file: Path, reports: Path) -> None:
    """Learn indefinitely; one line is written for each observed transition; the first line is for the transitions on disk."""
    with TransitionStore(file, "left_arm") as store, reports.open("a") as lines:
        agent = curious_agent(store)
        lines.write("\n")  # the one before may have been killed in a line
        while True:
            lines.write(f"{agent.transitions} {digest(agent)}\n")
            lines.flush()
            agent.step()


if __name__ == "__main__":
    learn(Path(sys.argv[1]), Path(sys.argv[2]))
