"""What every service shares: session, delivery classes, Rate, life cycle, configuration, and the live Plant."""
