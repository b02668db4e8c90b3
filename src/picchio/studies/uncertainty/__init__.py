"""How sure a life is: values that are not exactly known, drawn by their spreads."""
