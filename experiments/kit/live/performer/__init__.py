"""A service that performs an experiment on the live robot, and its launch; see `Config`."""
