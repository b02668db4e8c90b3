"""How far out of noise a power stands, against the distribution that it has."""

import numpy as np
import pytest
from scipy.stats import gamma, norm

from picchio.diagnosis.percussion.criteria.whiteness import BAND_LIMIT, standard_deviations


@pytest.mark.parametrize("ordinates", [12, 30, 75, 1000])
@pytest.mark.parametrize("chance", [0.9, 0.5, 1e-3, norm.sf(BAND_LIMIT)])
def test_a_power_stands_out_as_often_as_a_normal_variable(ordinates, chance):
    """A periodogram's ordinates are exponential; so few of them have a long upper tail."""
    power = gamma.isf(chance, ordinates) / ordinates
    said = norm.sf(standard_deviations(power, 1.0 / np.sqrt(ordinates)))
    assert said == pytest.approx(chance, rel=0.25)
