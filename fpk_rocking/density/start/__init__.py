"""The begin of a run: from a start at a point, or a narrow Gaussian, to the first density that the mesh resolves."""
