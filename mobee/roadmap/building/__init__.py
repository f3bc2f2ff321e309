# SPDX-License-Identifier: Apache-2.0
"""Task-relevant roadmaps: task spaces, the advancing front, and the flood (thesis 3.3)."""
