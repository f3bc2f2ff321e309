# SPDX-License-Identifier: Apache-2.0
"""The build hook of the native core: hatchling calls it before it packs a wheel or makes the project importable in place.

It is not part of the library; pyproject.toml names this file.
"""

from __future__ import annotations

import platform
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parent))
import build as core  # noqa: E402  (the file beside this one)


class CoreHook(BuildHookInterface[Any]):
    """Builds the core into mobee/_core: for a wheel for every processor level, in place for the level of this machine."""

    def dependencies(self) -> list[str]:
        """Return the packages that the build needs beyond hatchling: a compiler, where the system has none."""
        try:
            stale = _stale(core.knowledge().machine_levels())
            return [core.zig_requirement()] if stale and core.compiler_for(stale).zig else []
        except core.CompilerMissing:
            return [core.zig_requirement()]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the core, and set which files hatchling packs and the tag of the wheel; exits with the compiler's message if it fails."""
        levels = core.knowledge().machine_levels() if version == "standard" else core.level_here()
        try:
            if stale := _stale(levels):
                for library in core.build(stale, core.compiler_for(stale), core.knowledge().FOLDER, strict=False):
                    self.app.display_info(f"built {library.name}")
        except core.BuildFailed as failure:
            sys.exit(str(failure))
        if version == "standard":
            libraries = [core.knowledge().library_file(level) for level in levels]
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{wheel_platform(libraries)}"
            build_data["force_include"].update({str(path): f"mobee/_core/{path.name}" for path in libraries})


def _stale(levels: Sequence[str]) -> list[str]:
    return [level for level in levels if not core.is_current(level, core.knowledge().FOLDER, strict=False)]


def wheel_platform(libraries: list[Path]) -> str:
    """Return the platform tag of a wheel with these libraries, such as "manylinux_2_17_x86_64" or "macosx_11_0_arm64".

    On Linux with the GNU C library, the tag has the oldest version of it with which all libraries run.
    """
    if sys.platform == "darwin":
        return f"macosx_{core.macos_version().replace('.', '_')}_{platform.machine()}"
    needed = [core.oldest_glibc(library) for library in libraries]
    if None in needed:
        return f"{sys.platform}_{platform.machine()}"
    return "manylinux_{}_{}_{}".format(*max(needed), platform.machine())  # type: ignore[type-var]  # None was excluded above
