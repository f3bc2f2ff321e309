# SPDX-License-Identifier: Apache-2.0
"""Replays a recording: on a monitor's page, or as the input of a new controller or model.

A replayed service runs in lockstep (every tick waits for its answer), and its messages are compared with the recorded ones. Two recordings
can be compared, too.
"""
