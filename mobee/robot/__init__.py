"""What a robot is, and the files that describe robots and worlds."""
