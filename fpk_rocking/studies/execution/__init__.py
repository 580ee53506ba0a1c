"""How the cells of a sweep are carried out: the work of one, the workers, and the file that keeps the rows."""
