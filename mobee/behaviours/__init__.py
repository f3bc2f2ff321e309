# SPDX-License-Identifier: Apache-2.0
"""Small behaviours that run beside agents (thesis 9.4.2): each moves one part according to what the cameras or the motors measure."""
