"""What the experiments of the thesis' chapter 7 share."""
