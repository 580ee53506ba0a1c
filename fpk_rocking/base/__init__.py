"""Tools that know nothing of rocking: checks of parameters, and the compiler with its disk cache."""
