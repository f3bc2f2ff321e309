"""The launcher: router, start order, supervision, status and stop."""
