"""What results have in common: what they are asked for, what stands beside their numbers, bins, distances, files."""
