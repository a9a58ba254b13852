"""Forces from common volumes: volumetric contact in place of the simulator's contact points."""
