"""The links' masses: given in place of the URDF's, spread over shapes, and whether they can be."""
