# SPDX-License-Identifier: Apache-2.0
"""The robots of the experiment own-robots: those of example-robot-data and pybullet_data, and generated ones of extreme size."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from mobee.errors import InvalidValue

EXAMPLES = {  # of example-robot-data, below its folder of robots
    "tiago": "tiago_description/robots/tiago.urdf",
    "tiago_no_hand": "tiago_description/robots/tiago_no_hand.urdf",
    "pr2": "pr2_description/urdf/pr2.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "g1": "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
    "baxter": "baxter_description/urdf/baxter.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "z1": "z1_description/urdf/z1.urdf",
    "so101": "so_arm_description/urdf/so101.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "anymal_b": "anymal_b_simple_description/robots/anymal.urdf",
    "romeo": "romeo_description/urdf/romeo.urdf",
    "iris": "iris_description/robots/iris.urdf",
    "go2": "go2_description/urdf/go2.urdf",
    "centauro": "centauro_description/urdf/centauro.urdf",
}
BULLET = {  # of pybullet_data
    "kuka": "kuka_iiwa/model.urdf",
    "panda_bullet": "franka_panda/panda.urdf",
    "r2d2": "r2d2.urdf",
    "minitaur": "quadruped/minitaur.urdf",
}
SEED = 28
CHAIN_JOINTS, STAR_JOINTS = 200, 300


def _chain() -> str:
    rng = np.random.default_rng(SEED)
    joints = [
        _joint_text(f"j{k}", f"l{k}", f"l{k + 1}", (0.0, 0.0, 0.1), rng.permutation([1.0, 0.0, 0.0]).tolist()) for k in range(CHAIN_JOINTS)
    ]
    return _robot_text("chain", [_link_text(f"l{k}", 0.1) for k in range(CHAIN_JOINTS + 1)], joints)


def _star() -> str:
    """Return the URDF text of a robot with 300 arms of one joint each, which begin on a sphere of radius 1 m and point outwards."""
    rng = np.random.default_rng(SEED)
    joints = []
    for k in range(STAR_JOINTS):
        height, angle = 1.0 - (2 * k + 1) / STAR_JOINTS, k * np.pi * (3.0 - np.sqrt(5.0))
        across = np.sqrt(1.0 - height * height)
        at = (float(across * np.cos(angle)), float(across * np.sin(angle)), float(height))
        pitch = float(np.arctan2(np.hypot(at[0], at[1]), at[2]))
        joints.append(
            _joint_text(f"j{k}", "hub", f"l{k}", at, [*rng.normal(size=2).tolist(), 0.0], (0.0, pitch, float(np.arctan2(at[1], at[0]))))
        )
    return _robot_text("star", ['<link name="hub"/>', *(_link_text(f"l{k}", 0.1) for k in range(STAR_JOINTS))], joints)


def _scaled(scale: float) -> str:
    axes = ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    joints = [_joint_text(f"j{k}", f"l{k}", f"l{k + 1}", (0.0, 0.0, 0.1 * scale), axis) for k, axis in enumerate(axes)]
    return _robot_text("scaled", [_link_text(f"l{k}", 0.1 * scale) for k in range(7)], joints)


GENERATED: dict[str, Callable[[], str]] = {
    f"chain of {CHAIN_JOINTS}": _chain,
    f"star of {STAR_JOINTS}": _star,
    "arm of 0.7 um": lambda: _scaled(1e-6),
    "arm of 700 m": lambda: _scaled(1e3),
}
ROBOTS = (*EXAMPLES, *BULLET, *GENERATED)


def examples_folder() -> Path:
    """Return the folder of robots of the package example-robot-data; raises InvalidValue if it is not installed."""
    for place in sys.path:
        folder = Path(place) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
        if folder.is_dir():
            return folder
    raise InvalidValue(
        "example-robot-data is not installed. Try: pip install --target erd example-robot-data==6.0.0 --no-deps; "
        "--data erd/cmeel.prefix/share/example-robot-data/robots"
    )


def robot_file(name: str, examples: Path, folder: Path) -> Path:
    """Return the path of the URDF of a robot.

    `name`: one of ROBOTS.  `examples`: folder of example-robot-data.  `folder`: where a generated robot is written.  Raises InvalidValue if
    pybullet_data is needed and missing.
    """
    if name in EXAMPLES:
        return examples / EXAMPLES[name]
    if name in BULLET:
        spec = importlib.util.find_spec("pybullet_data")
        if spec is None or not spec.submodule_search_locations:
            raise InvalidValue(
                "pybullet_data is not installed, or was left out by ./launch: pip install --force-reinstall --no-deps pybullet"
            )
        return Path(spec.submodule_search_locations[0]) / BULLET[name]
    path = folder / f"{name.replace(' ', '_')}.urdf"
    path.write_text(GENERATED[name](), encoding="utf-8")
    return path


def _robot_text(name: str, links: list[str], joints: list[str]) -> str:
    return "\n".join([f'<robot name="{name}">', *links, *joints, "</robot>", ""])


def _link_text(name: str, length: float) -> str:
    """Return the URDF text of a link, a rod along z from its origin, `length` in m; a tenth of it is free at each end."""
    return (
        f'<link name="{name}"><collision><origin xyz="0 0 {length / 2!r}"/>'
        f'<geometry><cylinder radius="{length / 8!r}" length="{0.8 * length!r}"/></geometry></collision></link>'
    )


def _joint_text(
    name: str,
    parent: str,
    child: str,
    at: tuple[float, float, float],
    axis: list[float],
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> str:
    place, direction, rpy = (" ".join(map(repr, numbers)) for numbers in (at, axis, turn))
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{place}" rpy="{rpy}"/>'
        f'<axis xyz="{direction}"/><limit lower="-1.5" upper="1.5" velocity="1" effort="10"/></joint>'
    )
