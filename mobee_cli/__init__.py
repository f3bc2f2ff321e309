"""The command `mobee`: one file a verb."""
