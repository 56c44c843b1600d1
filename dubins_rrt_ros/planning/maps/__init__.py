"""Free and occupied space, and the readers of map files."""
