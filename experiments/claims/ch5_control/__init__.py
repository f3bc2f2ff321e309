"""Thesis chapter 5: the control law of MoBeE 2.0."""
