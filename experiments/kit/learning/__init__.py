"""Shared by experiments about learning the outcomes of actions."""
