"""What can be written where: the effects of the catalogue and the keys of every file format."""
