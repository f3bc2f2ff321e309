"""Figures of the documentation, each made by one program."""
