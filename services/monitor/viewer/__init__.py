# SPDX-License-Identifier: Apache-2.0
"""The 3D view of the page and the recording, in Rerun."""

import os

os.environ.setdefault("RUST_LOG", "error")  # Rerun warns at every start that a recording has no footer, which is intended (output.py)
