"""S-N curves in shear: the curve, its library, its fit to tests."""
