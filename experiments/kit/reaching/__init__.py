"""What the experiments on reaching share: targets, the scene, the truth about both, and what is learned of them."""
