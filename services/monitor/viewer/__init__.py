# SPDX-License-Identifier: Apache-2.0
"""The 3D view of the robot in Rerun, for the monitor's page and for its recording."""

import os

os.environ.setdefault("RUST_LOG", "error")  # Rerun warns at every start that a recording has no footer, which is intended (output.py)
