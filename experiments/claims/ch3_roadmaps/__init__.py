# SPDX-License-Identifier: Apache-2.0
"""Thesis chapters 3 and 4.3: poses and roadmaps from cost functions, and roadmaps that learn from contacts."""
