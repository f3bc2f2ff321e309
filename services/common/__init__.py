# SPDX-License-Identifier: Apache-2.0
"""Common code of the services: sessions, streams and calls on the bus, life cycle, configuration, and lockstep.

It also has the live plant, by which an agent acts with a part of the running robot.
"""
