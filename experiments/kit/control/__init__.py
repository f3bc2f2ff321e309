"""Shared by experiments about the control law."""
