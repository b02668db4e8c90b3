"""What percussion and motion records are judged by alike."""

from __future__ import annotations

BEYOND_DOUBT = 0.99
"""The least confidence, over the poses, of what is claimed though not all is explained."""

MOSTLY = 0.8
"""The least share of the held-out excess that the causes of a `partial` verdict explain.

"Most of it" in the verdict's words. Four fifths, not a half: a wrong cause that is merely like the
true one takes away half of its power as soon as the two are correlated by 0.71 (the share is the
correlation squared), which stiffness, inertia and friction of one joint often are; by 0.89 they
hardly ever are without being told as a set.
"""
