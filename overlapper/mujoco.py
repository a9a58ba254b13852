"""The geoms of a MuJoCo simulation, and their overlaps.

    import mujoco
    from overlapper.mujoco import Bodies

    bodies = Bodies(model, data)
    mujoco.mj_step(model, data)
    bodies.update()
    for contact in bodies.overlaps():
        print(contact.geomA, contact.geomB, contact.overlap.volume)

Shapes and pair rules are read once, poses at every step. pybullet is not needed.
"""

from overlapper.simulation.contacts import Contacts
from overlapper.simulation.first_overlaps import FirstOverlap, FirstOverlaps
from overlapper.simulation.forces.contact import VolumetricContact
from overlapper.simulation.forces.forces import Forces
from overlapper.simulation.forces.pads import TaxelGrid, Taxels
from overlapper.simulation.forces.tactile import TactileImage
from overlapper.simulation.links import LinkContact, LinkContacts, link_contacts
from overlapper.simulation.mujoco.bodies import Bodies
from overlapper.simulation.mujoco.contact import GeomContact

__all__ = [
    "Bodies",
    "Contacts",
    "FirstOverlap",
    "FirstOverlaps",
    "Forces",
    "GeomContact",
    "LinkContact",
    "LinkContacts",
    "TactileImage",
    "TaxelGrid",
    "Taxels",
    "VolumetricContact",
    "link_contacts",
]
