"""What experiments share: sweeps, statistics, figures, records, live runs."""
