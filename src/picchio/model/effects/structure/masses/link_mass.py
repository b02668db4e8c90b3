"""A link heavier or lighter than the URDF says."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, factor
from picchio.model.effects.evidence import Evidence
from picchio.model.plant import Changes


class LinkMass(Effect):
    """Mass and inertia of one link are `scale` times the URDF's; its centre of mass is kept."""

    name = "link_mass"
    where = "structure"
    target_kind = "link"
    parameters = (factor("scale", 0.05, 20.0, "true mass over the URDF's"),)
    meaning = "the link's mass and inertia are not the URDF's"
    exceeds = "link_mass"
    mark = "link mass"
    tried = ({"scale": 1.12},)

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """The links that have a mass."""
        links = evidence.robot.tree.links
        return [link for link in super().targets(evidence) if links.get(link) is not None]

    def structure(self, plant: Changes) -> None:
        """Add the link's own inertia `scale` - 1 times."""
        plant.add_mass(self.values["scale"] - 1.0, self.target)
