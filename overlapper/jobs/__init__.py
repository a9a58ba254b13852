"""Work done by other processes, here or on a cluster, whether one of them raises, hangs or dies."""
