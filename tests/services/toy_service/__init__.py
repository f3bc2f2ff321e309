"""A service that fails on request, for the tests of its supervision."""
