# SPDX-License-Identifier: Apache-2.0
"""Makes the packages of the live system and of the command `mobee` importable: `services`, `bus_schema`, `experiments` and `mobee_cli`.

A wheel installs these four packages inside this folder, so that site-packages holds no package of such a general name as `services`.
In a clone of the repository they stand beside this folder.  Importing this module puts the folder that contains them first in `sys.path`;
after that, `import services` finds MoBeE's package, also where the working directory has a folder of that name.  A script of yours that
uses the bus begins with::

    import mobee_system
    from services.common.service import Service
"""

from __future__ import annotations

import signal
import sys
from pathlib import Path

PACKAGES = ("services", "bus_schema", "experiments", "mobee_cli")

_HERE = Path(__file__).parent
FOLDER = _HERE if (_HERE / PACKAGES[0]).is_dir() else _HERE.parent
"""The folder that holds the four packages."""

if sys.path[:1] != [str(FOLDER)]:
    sys.path.insert(0, str(FOLDER))


def main() -> int:
    """Run the command `mobee`; return its exit code."""
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C during the imports ends the process without a traceback
    if "" not in sys.path and not sys.flags.safe_path:
        sys.path.append("")  # for what users name as module:name, as in the services; last, so that their files hide no module
    from mobee_cli.__main__ import main as run_command

    signal.signal(signal.SIGINT, handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as at Ctrl-C, what a verb has started ends with it
    return run_command()
