"""The collision shapes of a running pybullet simulation, and their overlaps.

Shapes are read once, and poses at every step. Surfaces are nominal or, with surface="margin", those that Bullet
collides with. Bullet lays a margin of 1 mm around convex hulls. These are mesh shapes, and the `<cylinder>` of a URDF,
which becomes a 32-gon hull. Pairs are those that the simulator lets collide.
"""

from typing import TYPE_CHECKING

from overlapper.face import lazily
from overlapper.install import simulator_hint

if TYPE_CHECKING:
    from overlapper.simulation.asked_pairs import Among
    from overlapper.simulation.bullet.bodies import Bodies
    from overlapper.simulation.bullet.recorder import Recorder
    from overlapper.simulation.cautions import (
        NoDirectionWarning,
        NoStepWarning,
        SelfCollisionWarning,
        SkippedShapeWarning,
        SubstepsWarning,
        UnknownBodyWarning,
        UnsettledWarning,
    )
    from overlapper.simulation.contacts import Contact, Contacts
    from overlapper.simulation.first_overlaps import FirstOverlap, FirstOverlaps
    from overlapper.simulation.forces.contact import VolumetricContact
    from overlapper.simulation.forces.derivatives import Kink, StepDerivatives
    from overlapper.simulation.forces.forces import Forces
    from overlapper.simulation.forces.pads import TaxelGrid, Taxels
    from overlapper.simulation.forces.tactile import TactileImage
    from overlapper.simulation.links import LinkContact, LinkContacts, link_contacts
    from overlapper.simulation.model import Decomposed, Skipped
    from overlapper.simulation.report import Report
    from overlapper.simulation.settings import Concave, Surface

__all__ = [
    "Among",
    "Bodies",
    "Concave",
    "Contact",
    "Contacts",
    "Decomposed",
    "FirstOverlap",
    "FirstOverlaps",
    "Forces",
    "Kink",
    "LinkContact",
    "LinkContacts",
    "NoDirectionWarning",
    "NoStepWarning",
    "Recorder",
    "Report",
    "SelfCollisionWarning",
    "Skipped",
    "SkippedShapeWarning",
    "StepDerivatives",
    "SubstepsWarning",
    "Surface",
    "TactileImage",
    "TaxelGrid",
    "Taxels",
    "UnknownBodyWarning",
    "UnsettledWarning",
    "VolumetricContact",
    "link_contacts",
]

# These names are imported on first use. pybullet prints its build time on import, and not all of them need it.
__getattr__ = lazily(
    __name__,
    {
        "asked_pairs": ("Among",),
        "bullet.bodies": ("Bodies",),
        "contacts": ("Contact", "Contacts"),
        "model": ("Decomposed", "Skipped"),
        "settings": ("Concave", "Surface"),
        "cautions": (
            "NoDirectionWarning",
            "NoStepWarning",
            "SelfCollisionWarning",
            "SkippedShapeWarning",
            "SubstepsWarning",
            "UnknownBodyWarning",
            "UnsettledWarning",
        ),
        "first_overlaps": ("FirstOverlap", "FirstOverlaps"),
        "forces.contact": ("VolumetricContact",),
        "forces.derivatives": ("Kink", "StepDerivatives"),
        "forces.forces": ("Forces",),
        "forces.pads": ("TaxelGrid", "Taxels"),
        "forces.tactile": ("TactileImage",),
        "links": ("LinkContact", "LinkContacts", "link_contacts"),
        "bullet.recorder": ("Recorder",),
        "report": ("Report",),
    },
    needs=simulator_hint(),
)
