"""The picture of the running system in Rerun: a browser page and a recording."""
