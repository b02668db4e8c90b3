"""From the equations of motion to x(t): modes, steady state, response from rest."""
