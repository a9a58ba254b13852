"""The warnings of this package; they are known without a simulator, so that they can be waited for."""


class SkippedShapeWarning(UserWarning):
    """A shape of the simulation is not modelled: its overlaps are not found."""


class UnknownBodyWarning(UserWarning):
    """A body is named that is not in the simulation."""


class SelfCollisionWarning(UserWarning):
    """pybullet keeps links of a body apart that are no pair here: their overlaps are not looked for."""


class NoDirectionWarning(UserWarning):
    """A body lies within another or goes through it: what they share has no side to push to."""


class SubstepsWarning(UserWarning):
    """The substeps are too few for the stiffness: contacts lose energy."""
