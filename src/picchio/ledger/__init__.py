"""Counting: the blows that logs show, the damage so far, what is left, what changed.

A log becomes samples (`samples`), a ledger keeps those that matter (`store`), and blows, bursts and
damage follow from all that is kept, in the order of time (`blows`, `damage`): never from files.
"""
