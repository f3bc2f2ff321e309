# SPDX-License-Identifier: Apache-2.0
"""Makes films of runs: draws the frames in the style of the monitor's web page, and writes the video files."""
