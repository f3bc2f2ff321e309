# SPDX-License-Identifier: Apache-2.0
"""What all services share: session, delivery classes, rate, life cycle, configuration, and the live plant."""
