"""The service that crosses: a Walker on the bus, and who makes the ball solid."""
