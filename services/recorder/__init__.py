# SPDX-License-Identifier: Apache-2.0
"""The flight recorder as a process: writes every message of the bus to MCAP files, which Foxglove and Rerun open.

Reads: all streams that are published in any case, with `everything` all streams, and all liveliness tokens.
Writes: only files. Its end changes nothing for the others.
"""
