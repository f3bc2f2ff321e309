"""What `mobee bench` will run: own figures beside the peers."""
