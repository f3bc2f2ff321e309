# SPDX-License-Identifier: Apache-2.0
"""The launcher: opens the router, starts and supervises the services, reports their status, and stops them.

Reads: alive/*/* (readiness), the `stat` of every service it started.
Writes: alive/router/{id}, alive/launcher/{id}, event/launcher, estop (if a vital service is given up, and to repeat a stop that robot_sim
has not confirmed); answers launcher/rpc/*.
"""
