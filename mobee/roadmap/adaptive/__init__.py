"""Adaptive roadmaps (thesis 4.2, 4.3, 9.4.5)."""
