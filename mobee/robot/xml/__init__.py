# SPDX-License-Identifier: Apache-2.0
"""Reads zero-position XML (MoBeE's own format for robots, thesis 2.3.1) of every version of the grammar, and writes the current version."""
