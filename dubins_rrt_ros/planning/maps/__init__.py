"""Free and occupied space, and the readers of map files: the only room that reads any. It knows no vehicle."""
