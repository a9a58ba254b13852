"""Forces from what bodies share: volumetric contact in place of the simulator's contact points."""
