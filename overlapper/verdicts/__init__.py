"""Tables of the same scene compared: what was recorded, how far it may be off, and what has moved."""
