# SPDX-License-Identifier: Apache-2.0
"""Compiles an MJCF file with the package mujoco, and finds the files of MuJoCo Menagerie with the package mujoco-menagerie.

The compiled model gives names and kinds as text. mujoco-menagerie downloads a robot at its first use. In the library, only this module
imports these two packages.
"""

from __future__ import annotations

import importlib.util
import re
import warnings
import xml.sax
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import NotInstalled, RobotFileError, Simplified
from mobee.robot.urdf.motors import LEAST
from mobee.robot.urdf.tree import FARTHEST, Frame
from mobee.robot.xml.file import LineHandler, is_file, parse_content, read_content

ROOT = "mujoco"  # the root element of an MJCF file
MENAGERIE = "mujoco_menagerie"


class _RootTag(LineHandler):
    """Notes the tag of the root element and reads no further."""

    tag = ""

    def startElement(self, name: str, attributes: object) -> None:
        """Called by sax at the first element."""
        self.tag = name
        raise xml.sax.SAXException("enough")


def is_mjcf(path: Path) -> bool:
    """Return whether a file is an MJCF file: its name ends in .xml or .mjcf, and its root element is <mujoco>."""
    if path.suffix.lower() not in (".xml", ".mjcf") or not is_file(path):
        return False
    handler = _RootTag()
    try:
        parse_content(path, read_content(path), handler)
    except (RobotFileError, xml.sax.SAXException):
        pass  # its reader reports what is wrong with the file
    return handler.tag == ROOT


@dataclass(frozen=True, slots=True, eq=False)
class Compiled:
    """A model as MuJoCo compiles it, with hinges and slides at zero; lists are in the order of MuJoCo's ids.

    Joints that an equality fixes are at their fixed positions. `path`: path of the file. `model`: MuJoCo's MjModel, a table of arrays.
    `bodies`, `inertial`, `geoms`, `sites`, `cameras`: the frames of these elements in the world's frame; `inertial`: at
    the centres of mass. `anchors` (m), `axes`: (joints, 3), a point on the axis and the unit axis of each joint, in the world's frame.
    `names[kind]`: the names of the elements of a kind ("body", "joint", "geom", "site", "key" and so on); an element without a name gets
    one from its kind and number. `lines[kind]`: the lines of these elements in the file; 0 if MuJoCo does not record the line.
    `joint_kinds`, `geom_kinds`, `equality_kinds`, `camera_modes`: MuJoCo's type of each such element as text, for example "hinge".
    `transmissions`: what each actuator acts on, for example "joint". `wraps`: type of each element of all tendons. `held`: numbers of the
    joints that an equality fixes.
    """

    path: Path
    model: Any
    bodies: tuple[Frame, ...]
    inertial: tuple[Frame, ...]
    geoms: tuple[Frame, ...]
    sites: tuple[Frame, ...]
    cameras: tuple[Frame, ...]
    anchors: Array
    axes: Array
    names: dict[str, tuple[str, ...]]
    lines: dict[str, tuple[int, ...]]
    joint_kinds: tuple[str, ...]  # free, ball, slide, hinge
    geom_kinds: tuple[str, ...]  # plane, hfield, sphere, capsule, ellipsoid, cylinder, box, mesh, sdf
    equality_kinds: tuple[str, ...]  # connect, weld, joint, tendon, ...
    transmissions: tuple[str, ...]  # of actuators: joint, jointinparent, tendon, site, ...
    wraps: tuple[str, ...]  # elements of tendons: joint, site, sphere, ...
    camera_modes: tuple[str, ...]  # fixed, track, ...
    held: frozenset[int]

    def where(self, kind: str, index: int) -> str:
        """Return "file:line" of an element; `kind`: a key of the dict `names`, `index`: MuJoCo's id of the element."""
        return f"{self.path}:{max(self.lines[kind][index], 1)}"


KINDS = ("body", "joint", "geom", "site", "key", "equality", "actuator", "tendon", "camera", "mesh")


def held_positions(model: Any, joint_equality: int) -> dict[int, float]:
    """Return the position [rad or m] of each joint that a joint equality fixes; the keys are MuJoCo's joint numbers.

    Such an equality has a single joint, or a polynomial of the other joint that is constant. `model`: MuJoCo's model. `joint_equality`:
    MuJoCo's number of this kind of equality, mjEQ_JOINT.
    """
    constant = (model.eq_obj2id < 0) | (np.abs(model.eq_data[:, 1:5]) < LEAST).all(axis=1)
    fixed = np.flatnonzero((model.eq_type == int(joint_equality)) & (model.eq_active0 != 0) & constant).tolist()
    joints = model.eq_obj1id[fixed].tolist()
    return {joint: float(model.qpos0[model.jnt_qposadr[joint]] + model.eq_data[k, 0]) for k, joint in zip(fixed, joints, strict=True)}


_warnings = Lock()  # MuJoCo has one handler of warnings for all threads


def compile_mjcf(path: Path) -> Compiled:
    """Compile an MJCF file with its includes, defaults and meshes.

    Raises RobotFileError with MuJoCo's message if MuJoCo refuses the file, or if the file has a NaN or a place farther than 1e6 m;
    NotInstalled without the package mujoco.
    """
    try:
        import mujoco
    except ModuleNotFoundError as error:
        raise NotInstalled(f'{path} is an MJCF file, which is read through the package mujoco: pip install "mobee[mjcf]"') from error
    with _warnings:
        before = mujoco.get_mju_user_warning()
        said: list[str] = []
        mujoco.set_mju_user_warning(said.append)  # else MuJoCo writes MUJOCO_LOG.TXT into the working directory
        try:
            spec = mujoco.MjSpec.from_file(str(path))
            if any("NaN" in text for text in said):  # what the compiler says of it does not name the cause
                problem = "a number in this file, or in one that it includes, is nan"
                raise RobotFileError(f"{path}: {problem}. Write a decimal number such as -0.25.")
            model = spec.compile()
        except ValueError as error:
            problem = " ".join(str(error).split()).rstrip(".")
            line = re.search(r"line (\d+)", problem)
            place = f"{path}:{line.group(1)}" if line else f"{path}"
            raise RobotFileError(f"{place}: MuJoCo refuses this file: {problem}. {_remedy(problem)}.") from None
        finally:
            mujoco.set_mju_user_warning(before)
    data = mujoco.MjData(model)
    kinds = _kinds(mujoco.mjtJoint, "mjJNT_", model.jnt_type)
    moving = [kind in ("hinge", "slide") for kind in kinds]
    data.qpos[model.jnt_qposadr[moving]] = 0.0
    held = held_positions(model, mujoco.mjtEq.mjEQ_JOINT)
    for joint, position in held.items():
        data.qpos[model.jnt_qposadr[joint]] = position
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    _check_numbers(path, (data.xpos, data.xanchor, data.geom_xpos, data.site_xpos, data.cam_xpos, data.xipos, model.body_mass))
    names, lines = _named(model, mujoco), _lines(spec)
    return Compiled(
        path=path,
        model=model,
        bodies=_frames(data.xpos, data.xmat),
        inertial=_frames(data.xipos, data.ximat),
        geoms=_frames(data.geom_xpos, data.geom_xmat),
        sites=_frames(data.site_xpos, data.site_xmat),
        cameras=_frames(data.cam_xpos, data.cam_xmat),
        anchors=data.xanchor.copy(),
        axes=data.xaxis.copy(),
        names=names,
        lines={kind: lines.get(kind, ()) if len(lines.get(kind, ())) == len(own) else (0,) * len(own) for kind, own in names.items()},
        joint_kinds=kinds,
        geom_kinds=_kinds(mujoco.mjtGeom, "mjGEOM_", model.geom_type),
        equality_kinds=_kinds(mujoco.mjtEq, "mjEQ_", model.eq_type),
        transmissions=_kinds(mujoco.mjtTrn, "mjTRN_", model.actuator_trntype),
        wraps=_kinds(mujoco.mjtWrap, "mjWRAP_", model.wrap_type),
        camera_modes=_kinds(mujoco.mjtCamLight, "mjCAMLIGHT_", model.cam_mode),
        held=frozenset(held),
    )


def _check_numbers(path: Path, numbers: Sequence[Array]) -> None:
    """Raise RobotFileError if one of the numbers, places [m] and masses [kg], is not from -1e6 to 1e6."""
    if not all((np.abs(some) <= FARTHEST).all() for some in numbers):
        problem = f"an element is farther than {FARTHEST:g} m from the origin, or heavier than {FARTHEST:g} kg"
        raise RobotFileError(f"{path}: {problem}. MJCF counts in metres and kilograms: correct its pos, ref or mass.")


@lru_cache(maxsize=2)
def meshes_of(path: Path) -> dict[str, tuple[Array, Ints]]:
    """Return a dict from the name of each mesh of an MJCF file to its vertices (v, 3) m and its triangles (t, 3), indices of vertices.

    The vertices are in the frame of the geom that has the mesh. Raises RobotFileError if MuJoCo refuses the file, NotInstalled without the
    package mujoco.
    """
    compiled = compile_mjcf(path)
    model, found = compiled.model, {}
    for mesh, name in enumerate(compiled.names["mesh"]):
        vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        found[name] = model.mesh_vert[vertices].astype(np.float64), model.mesh_face[faces].astype(np.intp)
    return found


def _remedy(problem: str) -> str:
    if "opening file" in problem or "file not found" in problem.lower():
        return "Put the file where the MJCF names it, relative to the MJCF's folder and its meshdir"
    if "nknown file extension" in problem or "decoder" in problem:
        return "Convert the mesh to .stl or .obj"
    return "Correct it there; `python -m mujoco.viewer --mjcf FILE` shows a file that MuJoCo accepts"


def _kinds(enumeration: Any, prefix: str, values: Sequence[int]) -> tuple[str, ...]:
    return tuple(enumeration(int(value)).name.removeprefix(prefix).lower() for value in values)


def _frames(positions: Array, rotations: Array) -> tuple[Frame, ...]:
    return tuple(Frame(p.copy(), r.reshape(3, 3).copy()) for p, r in zip(positions, rotations, strict=True))


def _named(model: Any, mujoco: Any) -> dict[str, tuple[str, ...]]:
    """Return the names of all elements of each kind, each once."""
    counts = (model.nbody, model.njnt, model.ngeom, model.nsite, model.nkey, model.neq, model.nu, model.ntendon, model.ncam, model.nmesh)
    found = {}
    for kind, count in zip(KINDS, counts, strict=True):
        code = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        given = [mujoco.mj_id2name(model, code, index) or "" for index in range(count)]
        taken = set(filter(None, given))
        found[kind] = tuple(name if name.strip() else _unused(f"{kind}_{index}", taken) for index, name in enumerate(given))
    return found


def _unused(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name


def _lines(spec: Any) -> dict[str, tuple[int, ...]]:
    """Return the lines in the file of the elements of a MuJoCo specification (MjSpec), for each kind of element (such as "joint").

    The index of a line is the element's id. MuJoCo notes the line in the text `info`, as "line 12"; 0: it does not note it.
    """
    tables = {"body": spec.bodies, "joint": spec.joints, "geom": spec.geoms, "site": spec.sites, "key": spec.keys, "camera": spec.cameras}
    found = {}
    for kind, elements in tables.items():
        numbers = np.zeros(len(elements), dtype=int)
        for element in elements:
            word = element.info.rpartition("line ")[2].split()
            if word and word[0].isdecimal() and 0 <= element.id < len(numbers):
                numbers[element.id] = int(word[0])
        found[kind] = tuple(numbers.tolist())
    return found


def menagerie_names() -> tuple[str, ...]:
    """Return the names of the robots of MuJoCo Menagerie; empty if the package mujoco-menagerie is not installed."""
    if importlib.util.find_spec(MENAGERIE) is None:
        return ()
    import mujoco_menagerie

    return tuple(mujoco_menagerie.names())


def menagerie_file(name: str) -> Path | None:
    """Return the path of the MJCF file of a robot of MuJoCo Menagerie; download it if necessary, with a warning before.

    The name may omit the maker if it is unambiguous: "panda" is "franka_emika_panda". Returns None if Menagerie has no such robot, or the
    package mujoco-menagerie is not installed. Raises RobotFileError if the download fails.
    """
    names = menagerie_names()
    found = [name] if name in names else [known for known in names if known.endswith(f"_{name}")]
    if len(found) != 1:
        return None
    import mujoco_menagerie

    robot, cache = mujoco_menagerie.get(found[0]), mujoco_menagerie.Cache()
    if cache.root is None and not cache.is_cached(robot):
        size = (robot.download_size or 0) / 1e6
        warnings.warn(f"mujoco-menagerie downloads {found[0]} ({size:.0f} MB) into {cache.dir}", Simplified, stacklevel=4)
    try:
        return Path(robot.xml(robot.default_model))
    except mujoco_menagerie.MenagerieError as error:
        raise RobotFileError(f"{name}: mujoco-menagerie cannot give this robot: {error}. Give the path of a file instead.") from None
