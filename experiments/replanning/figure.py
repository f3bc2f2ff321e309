"""Through the ball while it is a ghost, and around it when it turned solid (thesis fig. 4.7); and how soon."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.drawing.filmstrip import Strip, filmstrip
from experiments.drawing.motion import Motion
from experiments.kit.plots import new_figure
from experiments.replanning.findings import SOON
from experiments.replanning.measured import POSES, Measured
from experiments.replanning.scene import BALL, LEFT, MARKER, RIGHT, model, new_map, robot
from mobee.robot.robot import Array

VIEW = (20.0, 35.0)  # azimuth and elevation, degrees
STEPS = 40


def draw(launches: Sequence[Path], crossings: Sequence[Measured], path: Path) -> Path:
    """Two rows of pictures; the times are drawn beside, into a file of their own."""
    _times(crossings, path.with_name(f"{path.stem}-times.png"))
    kept = np.load(next(launch for launch in launches if (launch / POSES).exists()) / POSES)
    solid, bump = float(kept["solid"]), float(kept["bump"])

    def caption(motion: Motion, moment: int) -> str:
        t = motion.times[moment]
        told = "" if t < solid else ", solid" if t < bump else ", on around it"
        return f"{t:.1f} s{told}"

    through, around = _motion(_ghostly(), np.linspace(0.0, 1.0, STEPS), np.inf), _motion(kept["q"], kept["times"], solid)
    strips = [
        Strip(through, MARKER, (VIEW,), 6, "the ball is a ghost: the short way leads through it", lambda motion, moment: ""),
        Strip(around, MARKER, (VIEW,), 6, f"solid after {solid:.1f} s, felt after {bump:.1f} s: the hand goes around it", caption),
    ]
    return filmstrip(strips, path, height=260)


def _ghostly() -> Array:
    """The edge through the ball, (T, n) rad."""
    space = new_map().space
    q = np.repeat(robot().home[None], STEPS, axis=0)
    shares = np.linspace(0.0, 1.0, STEPS)[:, None]
    q[:, robot().parts[space.part].slice] = space.target(RIGHT) + shares * (space.target(LEFT) - space.target(RIGHT))
    return q


def _motion(q: Array, times: Array, solid: float) -> Motion:
    """Poses with the ball as it was in each."""
    known, poses, objects = model(), [], []
    for row, t in zip(q, times, strict=True):
        if t >= solid and known.world.objects[BALL].role == "ghost":
            known.world.set_role(BALL, "obstacle")
        poses.append(known.evaluate(row))
        objects.append(poses[-1].objects)
    return Motion(tuple(poses), np.asarray(times), tuple(objects))


def _times(crossings: Sequence[Measured], path: Path) -> None:
    drawing = new_figure(6.0, 3.4)
    axes = drawing.subplots()
    for name, label in (("command", "a command of the new way is in force"), ("turn", "the joints come no nearer to the old goal")):
        values = np.sort([getattr(one, name) for one in crossings if one.bumped])
        axes.step(values, np.arange(1, len(values) + 1) / max(len(values), 1), where="post", label=label)
    axes.axvline(SOON, color="0.5", linestyle="--", linewidth=0.8)
    axes.set(xlabel="ms from the bump, on robot_sim's clock", ylabel="share of crossings", xlim=(0.0, None), ylim=(0.0, 1.02))
    axes.grid(alpha=0.2)
    axes.legend(fontsize=8)
    drawing.savefig(path, dpi=110)
