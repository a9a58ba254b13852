"""Which pairs of links of a robot can overlap at all: joints placed at random within their limits, many at once."""
