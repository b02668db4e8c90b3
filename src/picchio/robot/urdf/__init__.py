"""The URDF itself: its bytes, its tree of links and joints, and whether it can move."""
