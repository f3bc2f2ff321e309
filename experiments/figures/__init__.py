"""The figures of the documentation that neither `mobee experiment figure` nor `mobee bench --figure` draws."""
