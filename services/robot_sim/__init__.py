"""The simulated robot: motors, safety gate, state streams and eye images."""
