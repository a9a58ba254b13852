"""Work in other processes, here or on a cluster. It goes on if one of them raises, hangs or dies."""
