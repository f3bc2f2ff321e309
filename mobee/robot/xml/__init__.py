# SPDX-License-Identifier: Apache-2.0
"""Reads and writes robots as zero-position XML, of every version of the grammar."""
