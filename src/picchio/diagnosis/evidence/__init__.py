"""One model of probability for all measured data: algebra, estimator, search, verdict."""
