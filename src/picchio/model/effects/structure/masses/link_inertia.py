"""A link whose mass, centre of mass and inertia are not the URDF's."""

from __future__ import annotations

import math
from typing import Self

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.inertia import stretched
from picchio.model.motion import Motion
from picchio.model.plant import Changes
from picchio.robot.dynamics.rigid_model import unit_inertia
from picchio.robot.flexible_robot import FlexibleRobot

_SPREAD = 0.5
_NAMES = ("mass", "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz")
_MEANINGS = (
    "logarithm of true mass over the URDF's",
    *(f"shift of the centre of mass along the body's {a}, over its extent" for a in "xyz"),
    *(f"logarithm of the body's stretch along its {a}" for a in "xyz"),
    *(f"shear of the body, {a}" for a in ("xy", "xz", "yz")),
)


class LinkInertia(Effect):
    """Mass, centre of mass and inertia of one link differ from the URDF's, as a body can.

    The URDF's link is made heavier, moved, stretched and sheared (log-Cholesky), so that no
    mass or inertia can become negative. What joints' torques do not tell stays near the URDF's.
    """

    name = "link_inertia"
    where = "structure"
    target_kind = "link"
    parameters = tuple(
        Parameter(name, lower=-2.5, upper=2.5, meaning=meaning, spread=_SPREAD)
        for name, meaning in zip(_NAMES, _MEANINGS, strict=True)
    )
    meaning = "the link's mass, centre of mass and inertia are not the URDF's"
    mark = "link mass"
    weighs = True
    usual = 8
    told_by = "at speeds and poses at which every joint above the link turns it about"
    refines = "link_mass"
    tried = ({"mass": 0.12}, {"x": 0.3, "zz": 0.1})
    takes = "motion"
    source = "Rucker, Wensing, IEEE Robotics and Automation Letters 7(2), 2022"

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """The links that have a mass."""
        links = evidence.robot.tree.links
        return [link for link in super().targets(evidence) if links.get(link) is not None]

    @classmethod
    def finer_than(cls, coarse: Effect) -> list[Self]:
        """A link of as many times the mass.

        Args:
            coarse: `link_mass` at work at the same link.
        """
        return [cls(coarse.target, mass=math.log(coarse.values["scale"]))]

    def _added(self, own: FloatArray) -> FloatArray:
        return stretched(own, [self.values[name] for name in _NAMES]) - own

    def structure(self, plant: Changes) -> None:
        """Add what the link has more than the URDF's."""
        own = unit_inertia(plant.robot.tree, self.target, None).toDynamicParameters()
        plant.add_body(self.target, self._added(np.asarray(own)))

    def motion(self, motion: Motion) -> None:
        """Add the torques of what the link has more than the URDF's."""
        if any(self.values.values()):
            motion.add_body(self.target, self._added(motion.link(self.target)))

    def follows(self, robot: FlexibleRobot) -> dict[str, tuple[float, str]]:
        """The link's mass and centre of mass."""
        own = np.asarray(unit_inertia(robot.tree, self.target, None).toDynamicParameters())
        ten = own + self._added(own)
        found = {"link_mass": (float(ten[0]), "kg")}
        for axis, moment in zip("xyz", ten[1:4], strict=True):
            found[f"com_{axis}"] = float(moment / ten[0]), "m"
        return found
