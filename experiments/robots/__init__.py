"""Writes the shipped robot files from numbers."""
