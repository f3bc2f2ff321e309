# SPDX-License-Identifier: Apache-2.0
"""The recorder as a process: writes the messages of the bus to MCAP files, which Foxglove and Rerun can open.

Reads: all streams except those that are published only for subscribers (with the setting `everything`: all streams), and all liveliness
tokens.
Writes: only files. If the recorder ends, nothing changes for the other services.
"""
