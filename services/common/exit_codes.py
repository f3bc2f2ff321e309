# SPDX-License-Identifier: Apache-2.0
"""Exit codes of the processes: services, the launcher and the subcommands of `mobee`."""

from __future__ import annotations

OK = 0
FAILED = 1  # it ran, and its task failed
BAD_INPUT = 2  # its settings or arguments are not valid: a new start with the same ones fails again
ENVIRONMENT = 3  # a fault of the machine or the running system: a package, a port, the bus, a folder
INTERRUPTED = 130  # by Ctrl-C; a shell reports the same: 128 and the number of SIGINT
