"""Thesis chapter 2: the model of robot and world."""
