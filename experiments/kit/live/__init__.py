"""Shared by experiments that run the live system."""
