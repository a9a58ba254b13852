"""Which pairs of links of a robot can overlap: sampled by joints at random within their limits, many at once."""
