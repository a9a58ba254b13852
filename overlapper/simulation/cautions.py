"""The warnings of this package. They can be imported without a simulator, so that filters can name them."""


class SkippedShapeWarning(UserWarning):
    """A shape of the simulation is not modelled, so its overlaps are not found."""


class UnknownBodyWarning(UserWarning):
    """A name is given to a body that is not in the simulation."""


class SelfCollisionWarning(UserWarning):
    """pybullet lets two links of a body collide that are not a pair here, so their overlaps are not looked for."""


class NoDirectionWarning(UserWarning):
    """A body lies within another or goes through it, so their overlap has no side to push to."""


class DepthWarning(UserWarning):
    """Two bodies are so deep in each other that their contact is no surface layer."""


class UnsettledWarning(UserWarning):
    """The solver of contact forces has ended before they were accurate."""


class SubstepsWarning(UserWarning):
    """The substeps are too few for the stiffness: contacts lose energy."""


class NoStepWarning(UserWarning):
    """Bodies have moved within the `with` of a VolumetricContact, which noticed no step."""
