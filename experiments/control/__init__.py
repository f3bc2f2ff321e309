"""How the control law was tuned."""
