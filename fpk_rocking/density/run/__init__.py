"""A scene at one resolution, and the density that it evolves: what one step is, by the kind of scene."""
