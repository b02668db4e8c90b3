"""Motion to second order in the deflections, nonlinear elements included."""
