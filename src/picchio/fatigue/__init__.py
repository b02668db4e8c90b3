"""Fatigue: stress, S-N curves and their fitting, rainflow, mean stress, Miner.

Arrays go in and out in SI units (Pa, N m, cycles). Counting compiles on its first call; importing
this package loads neither numba nor scipy.
"""
