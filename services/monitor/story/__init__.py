# SPDX-License-Identifier: Apache-2.0
"""What the agents do, expect and know, in words and numbers for people."""
