"""The stiffness of joints from tests made for it: loads and displacements, frequency responses."""
