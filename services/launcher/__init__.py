# SPDX-License-Identifier: Apache-2.0
"""The launcher: router, start order, supervision, status and stop.

Reads: alive/*/* (readiness), the `stat` of every service it started.
Writes: alive/router/{id}, alive/launcher/{id}, event/launcher, estop (if a vital service is given up); answers launcher/rpc/*.
"""
