"""Parameters of effects that let something beside the joints yield."""

from __future__ import annotations

from picchio.model.effects.effect import Parameter

# See `Plant.modal_share`.
MODAL_SHARE = Parameter(
    "modal_share",
    "1",
    neutral=1.0,
    lower=0.0,
    upper=1.0,
    meaning="1: the stated damping is that of the modes with this effect; 0: of the joints alone",
    size=1.0,
)


def stiffness(meaning: str, upper: float) -> Parameter:
    """Of what is rigid in the nominal model, N m/rad.

    Args:
        meaning: of the parameter, a sentence.
        upper: above it nothing yields that a record could show, N m/rad.

    Returns:
        the parameter; infinite where nothing yields.
    """
    return Parameter("stiffness", "N*m/rad", neutral=float("inf"), lower=1e-3, upper=upper,
                     logarithmic=True, meaning=meaning, by_inverse=True)  # fmt: skip


def damping(meaning: str, upper: float) -> Parameter:
    """Beside such a stiffness, N m s/rad.

    Args:
        meaning: of the parameter, a sentence.
        upper: N m s/rad.

    Returns:
        the parameter.
    """
    return Parameter(
        "damping", "N*m*s/rad", lower=1e-9, upper=upper, logarithmic=True, meaning=meaning
    )
