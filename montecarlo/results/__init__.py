"""What ensembles leave: states or counts, and what can be said of them with its sampling error."""
