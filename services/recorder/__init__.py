# SPDX-License-Identifier: Apache-2.0
"""The recorder as a process: writes the messages of the bus to MCAP files, which Foxglove and Rerun can open.

Reads: all streams that are published in any case (with the setting `everything`: all streams), and all liveliness tokens.
Writes: only files. If the recorder ends, nothing changes for the other services.
"""
