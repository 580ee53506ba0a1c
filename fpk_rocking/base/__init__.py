"""What knows nothing of rocking: refusals in one voice, and the compiler with its cache."""
