"""A link bends in its middle."""

from __future__ import annotations

import math
from typing import Self

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure.springs import yielding
from picchio.model.expansion import link_end
from picchio.model.plant import Changes


class LinkBending(Effect):
    """The link that a joint carries yields half-way to the next joint or the tool.

    It does so about two axes across it, as a beam does, first about its weaker one. Half of the
    link's mass is beyond the middle.
    """

    name = "link_bending"
    where = "structure"
    target_kind = "joint"
    parameters = (
        yielding.stiffness("about the axis about which the link bends more", upper=1e12),
        yielding.damping("about that axis", upper=1e8),
        Parameter("angle", "rad", lower=-6.3, upper=6.3, size=0.3, shape=True,
                  meaning="of that axis, across the link"),
        Parameter("ratio", neutral=1.0, lower=0.002, upper=1.0, logarithmic=True, shape=True,
                  meaning="this stiffness over that about the other axis"),
        Parameter("apart", neutral=1.0, lower=0.0, upper=1.15, size=0.2, shape=True, spread=0.2,
                  meaning="its halves' centres of mass, over those of a uniform rod"),
        yielding.MODAL_SHARE,
    )  # fmt: skip
    meaning = "the link that the joint carries bends half-way along"
    mark = "bending"
    refines = "transverse_compliance"
    source = (
        "pseudo-rigid-body model with one hinge: Howell, Compliant Mechanisms, 2001, ch. 5; "
        "Dwivedy, Eberhard, Mechanism and Machine Theory 41 (2006) 749"
    )

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """The flexible joints that turn and carry a link with a length."""
        return [
            j.name
            for j in evidence.robot.flexible_joints
            if j.kind == "revolute" and link_end(evidence.robot, j.name) is not None
        ]

    def structure(self, plant: Changes) -> None:
        """Let the two hinges within the link move."""
        values = self.values
        plant.modal_share = values["modal_share"]
        pair = (values["stiffness"], values["stiffness"] / values["ratio"])
        plant.add_bending(self.target, values["angle"], values["apart"], pair, values["damping"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Five times as stiff as the joint."""
        k, m = 5.0 * scales.stiffness[self.target], scales.inertia[self.target]
        return [{"stiffness": k, "damping": 0.04 * (k * m) ** 0.5, "ratio": 0.3}]

    @classmethod
    def finer_than(cls, coarse: Effect) -> list[Self]:
        """A link that yields as much about one axis as a bearing does, about three axes in turn.

        Args:
            coarse: `transverse_compliance` at work at the same joint.
        """
        shared = {key: coarse.values[key] for key in ("stiffness", "damping", "modal_share")}
        return [cls(coarse.target, **shared, ratio=0.3, angle=k * math.pi / 3.0) for k in range(3)]
