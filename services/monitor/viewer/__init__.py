# SPDX-License-Identifier: Apache-2.0
"""The 3D view of the page and the recording, in Rerun."""
