"""Where the mesh lies that a URDF names."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urlsplit

from mobee.robot.xml_file import is_file
from mobee.robot.xml_node import Node

PACKAGES = ("package", "model")
REMEDY = "Put the package's folder beside or above the URDF, or name where it lies in ROS_PACKAGE_PATH"


def find_mesh(node: Node) -> Path:
    """The file that a <mesh filename="..."> names.

    `package://name/...` is looked for from the URDF's folder upwards, then in ROS_PACKAGE_PATH and AMENT_PREFIX_PATH;
    a plain path starts at the URDF's folder. Raises RobotFileError with the places that were looked at.
    """
    given = node.text("filename")
    try:
        scheme, rest = urlsplit(given).scheme.lower(), given.partition("://")[2]
    except ValueError:  # brackets of an IPv6 address that is none
        scheme, rest = "?", ""
    if "\0" in given:
        node.fail("filename", "holds a zero byte", "Write a path")
    if "://" not in given:
        candidates, remedy = [node.file.parent / given], "Give a path that starts at the URDF's folder"
    elif scheme == "file":
        candidates, remedy = [node.file.parent / unquote(rest)], "Correct the path"
    elif scheme in PACKAGES:
        package, _, inner = rest.partition("/")
        candidates, remedy = list(_in_packages(node.file, package, inner)), REMEDY
    else:
        node.fail("filename", f"{given!r} cannot be followed", "Write package://, file:// or a path")
    for path in candidates:
        if is_file(path):
            return path
    looked = ", ".join(str(path) for path in candidates[:6]) + (f" and {len(candidates) - 6} more" if len(candidates) > 6 else "")
    node.fail("filename", f"no mesh {given!r} (looked at {looked})", remedy)


def _in_packages(urdf: Path, package: str, inner: str) -> Iterator[Path]:
    for folder in urdf.resolve().parents:
        yield folder / package / inner
        if folder.name == package:
            yield folder / inner
    for entry in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield Path(entry) / package / inner
        if Path(entry).name == package:
            yield Path(entry) / inner
    for entry in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(entry) / "share" / package / inner
