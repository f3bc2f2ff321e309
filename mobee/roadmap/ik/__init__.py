"""Poses from costs: natural gradient inverse kinematics (thesis 3.2)."""
