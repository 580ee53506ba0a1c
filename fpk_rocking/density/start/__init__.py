"""From a start that no mesh resolves to the first density that one does."""
