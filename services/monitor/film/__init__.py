# SPDX-License-Identifier: Apache-2.0
"""Films of runs: the frames, drawn as the page shows them, and the files."""
