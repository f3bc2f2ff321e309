# SPDX-License-Identifier: Apache-2.0
"""Exit codes of the processes: services, the launcher and the verbs of `mobee`."""

from __future__ import annotations

OK = 0
FAILED = 1  # it ran, and what it was asked to do failed
BAD_INPUT = 2  # its settings or arguments cannot be used: to start it again with the same ones does not help
ENVIRONMENT = 3  # the machine or the running system has to change: a package, a port, the bus, a folder
INTERRUPTED = 130  # by Ctrl-C; a shell reports the same: 128 and the number of SIGINT
