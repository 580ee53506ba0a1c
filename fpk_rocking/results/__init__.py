"""What the results of all engines have in common: their interface, remarks, bins, distances and files."""
