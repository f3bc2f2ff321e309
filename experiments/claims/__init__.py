"""The claims of the thesis and the paper, one module each, by chapter of the thesis."""
