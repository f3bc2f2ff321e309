"""Walking on adaptive maps: what the experiments of thesis 4.3 share."""
