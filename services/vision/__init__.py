"""The target locator: finds the ball in both eye images and puts it into the world of the model."""
