"""What the experiments about the control law share: rides of the offline plant, and what is measured of them."""
