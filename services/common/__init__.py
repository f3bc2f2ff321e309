# SPDX-License-Identifier: Apache-2.0
"""Common code of the services: session, kinds of delivery of messages, rate, life cycle, configuration, and the live plant."""
