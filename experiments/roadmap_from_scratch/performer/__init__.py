"""The service that explores: a MapExplorer on the bus."""
