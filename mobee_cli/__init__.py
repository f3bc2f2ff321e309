"""The command `mobee`: one file per verb."""
