# SPDX-License-Identifier: Apache-2.0
"""`mobee doctor`: checks this machine and this installation, and names a command that corrects each fault."""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import shutil
import socket
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

from mobee_cli.connect import add_endpoint
from services.common.exit_codes import ENVIRONMENT, OK

OLDEST_PYTHON = (3, 11)
LEAST_MEMORY, LEAST_DISK = 1.0, 0.5  # GB that a system with a page and the record of a long run take
LEAST_CORES = 2
EXTRAS = {
    "live": {"cryptography": "cryptography", "zenoh": "eclipse-zenoh", "msgspec": "msgspec", "tyro": "tyro"},
    "sim": {"mujoco": "mujoco-core", "pybullet": "pybullet", "icub_models": "icub-models"},
    "viz": {"rerun": "rerun-sdk", "trimesh": "trimesh", "collada": "pycollada", "fast_simplification": "fast-simplification"},
    "figures": {"matplotlib": "matplotlib"},
    "parquet": {"pyarrow": "pyarrow"},
    "reference": {"fcl": "python-fcl"},
    "planning": {"ompl": "ompl"},
    "bench": {"mujoco": "mujoco", "cma": "cma", "mink": "mink", "quantecon": "quantecon"},
}
"""The extras of this project. For each, the packages that can be imported and the distributions that contain them."""
WANTED = ("live", "sim", "viz")  # of `mobee launch`
_NOTES = """A line is ok, a note (`mobee launch` does not need it), or wrong, with the
command that mends it.
Exit code: 0 `mobee launch` can start here, 3 something is wrong."""

Verdict = Literal["ok", "note", "wrong"]


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check of this machine or installation, one entry of the report of `mobee doctor`.

    `subject`: what was checked. `verdict`: ok, note or wrong. `found`: what was found. `remedy`: what to do about it.
    """

    subject: str
    verdict: Verdict
    found: str
    remedy: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee doctor` to the parser."""
    parser.epilog = _NOTES
    add_endpoint(parser)
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee doctor`: check everything, print the findings, and return the exit code.

    0: `mobee launch` can start here; 3: something is wrong.
    """
    findings = list(examine(arguments.endpoint))
    if arguments.json:
        print(json.dumps([asdict(one) for one in findings], indent=2))
    else:
        for one in findings:
            print("\n".join(_lines(one)))
    return ENVIRONMENT if any(one.verdict == "wrong" for one in findings) else OK


def examine(endpoint: str) -> Iterator[Finding]:
    """Check Python, processor, memory, disk, compiled core, extra packages and running system, and yield the findings one by one.

    Each check is independent of the others.
    `endpoint`: address at which a running system, if there is one, has its router; also the address that a new system would use.
    """
    yield _python()
    yield _cores()
    yield _memory()
    yield _disk()
    yield _core()
    for extra in EXTRAS:
        yield _extra(extra)
    yield Finding("OpenGL", "ok", "not needed: pictures are computed on the CPU; the page needs a browser with WebGL")
    yield from _running(endpoint)


def _python() -> Finding:
    found = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}, mobee {_version('mobee') or 'from its sources'}"
    if sys.version_info < OLDEST_PYTHON:
        return Finding("Python", "wrong", found, "install Python 3.11 or newer, and mobee in it")
    return Finding("Python", "ok", found)


def _cores() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    load = os.getloadavg()[0]
    found = f"{cores} cores, load {load:.1f}"
    if cores < LEAST_CORES:
        return Finding("processor", "note", found, "a live system is slow on one core: mobee launch kinematic --headless")
    if load > cores:
        return Finding("processor", "note", found, "other programs use the machine: end them, or mobee launch --headless")
    return Finding("processor", "ok", found)


def _memory() -> Finding:
    try:
        lines = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
        free = int(lines["MemAvailable"].split()[0]) / 1e6
    except (OSError, KeyError, ValueError):
        return Finding("memory", "note", "not known on this system")
    if free < LEAST_MEMORY:
        return Finding("memory", "note", f"{free:.1f} GB free", "end other programs, or mobee launch --headless")
    return Finding("memory", "ok", f"{free:.1f} GB free")


def _disk() -> Finding:
    free = shutil.disk_usage(".").free / 1e9
    if not os.access(".", os.W_OK):
        return Finding("folder", "wrong", f"{Path.cwd()} cannot be written", "cd to a folder of yours, or mobee launch --runs DIR")
    if free < LEAST_DISK:
        return Finding("folder", "note", f"{free:.1f} GB free in {Path.cwd()}", "make room, or mobee launch --runs DIR")
    return Finding("folder", "ok", f"{free:.0f} GB free here")


def _core() -> Finding:
    """Load the native core, as every use of the library does."""
    try:
        from mobee._core import FORCED, choose, library
        from mobee._core.levels import processor_flags

        library()
        level = choose(os.environ.get(FORCED, ""), processor_flags())
    except ImportError as error:
        return Finding("native core", "wrong", f"cannot be imported: {error}", "pip install mobee")
    except Exception as error:  # CoreUnavailable, whose class may not be imported before; or what a damaged library raises
        text, _, remedy = " ".join(str(error).split()).partition(": ")
        return Finding("native core", "wrong", text, remedy or "python core/build.py")
    return Finding("native core", "ok", f"built for {level}, the widest that this processor runs")


def _extra(extra: str) -> Finding:
    packages = EXTRAS[extra]
    missing = [name for package, name in packages.items() if importlib.util.find_spec(package) is None]
    found = ", ".join(_installed(package, name) for package, name in packages.items() if name not in missing)
    if not missing:
        return Finding(f"extra {extra}", "ok", found)
    text = f"{', '.join(missing)} not installed" + (f"; {found}" if found else "")
    if missing == ["pybullet"]:
        return Finding(f"extra {extra}", "note", text, "not needed: MuJoCo moves the iCub too; PyBullet lacks wheels for some machines")
    return Finding(f"extra {extra}", "wrong" if extra in WANTED else "note", text, f'pip install "mobee[{extra}]"')


def _running(endpoint: str) -> Iterator[Finding]:
    """Yield the system at the endpoint; if there is none, the ports that a new one needs."""
    try:
        from services.launcher.checks import launcher_at
        from services.monitor.config import Config
    except ImportError as error:
        yield Finding("systems", "note", f"not known without {error.name}")
        return
    stat = launcher_at(endpoint)
    if stat is not None:
        since = f"one runs at {endpoint} since {stat.uptime / 60:.0f} min (launcher {stat.pid})"
        yield Finding("systems", "ok", f"{since}: {stat.text}", f"`mobee stop --endpoint {endpoint}` ends it")
        return
    yield Finding("systems", "ok", f"none runs at {endpoint}")
    if endpoint.startswith("tcp/"):
        port = int(endpoint.rpartition(":")[2])
        yield _port(port, f"mobee launch --endpoint tcp/127.0.0.1:{port + 1}")
    page = Config()
    for name in (name for name in page.__struct_fields__ if name.endswith("_port")):
        port = getattr(page, name)
        yield _port(port, f"mobee launch --set services.monitor.{name}={port + 1}")


def _port(port: int, remedy: str) -> Finding:
    return (
        Finding(f"port {port}", "ok", "free") if _is_free(port) else Finding(f"port {port}", "wrong", "in use by another program", remedy)
    )


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as servers do
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def _installed(package: str, distribution: str) -> str:
    """Return name and version of what provides a package: the distribution, or another that is used in its place, as pybullet-arm64."""
    if not _version(distribution):
        distribution = next(iter(metadata.packages_distributions().get(package, ())), distribution)
    return f"{distribution} {_version(distribution)}".strip()


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


def _lines(one: Finding) -> list[str]:
    columns = shutil.get_terminal_size().columns  # 80 in a pipe
    head, blank = f"{one.verdict:<7}{one.subject:<18}", " " * 25
    lines = textwrap.wrap(one.found, columns, initial_indent=head, subsequent_indent=blank, break_on_hyphens=False)
    if one.remedy:
        lines += textwrap.wrap(f"-> {one.remedy}", columns, initial_indent=blank, subsequent_indent=blank + "   ", break_on_hyphens=False)
    return lines
