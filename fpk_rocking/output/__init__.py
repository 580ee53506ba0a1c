"""Pictures, VTK files, tables and progress bars. Importing the package imports none of the libraries they need."""
