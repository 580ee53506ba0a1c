"""Results of the engines: ensembles, tallies and histories, and statistics of them with their sampling errors."""
