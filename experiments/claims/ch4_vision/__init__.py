# SPDX-License-Identifier: Apache-2.0
"""Claims about what the robot sees (thesis 4.1.2)."""
