"""Task-relevant roadmaps: the examples of thesis figures 3.1 to 3.11, one file each."""
