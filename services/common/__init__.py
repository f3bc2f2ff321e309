# SPDX-License-Identifier: Apache-2.0
"""Common code of the services: session, delivery classes, rate, life cycle, configuration, and the live plant."""
