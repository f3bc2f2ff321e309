"""Code that is shared by the experiments that run the live system."""
