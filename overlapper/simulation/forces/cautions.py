"""What there is to warn of when forces come from volumes; known without a simulator, so that it can be waited for."""


class NoDirectionWarning(UserWarning):
    """A body lies within another or goes through it: what they share has no side to push to."""


class SubstepsWarning(UserWarning):
    """The substeps are too few for the stiffness: contacts lose energy."""
