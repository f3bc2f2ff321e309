"""The benchmarks of `mobee bench`, one module each, and the programs that they compare with."""
