"""What all services share: session, delivery classes, rate, life cycle, configuration, and the live plant."""
