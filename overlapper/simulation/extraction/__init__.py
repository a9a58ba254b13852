"""The collision shapes of a pybullet client, read once: convex shapes in the frames of their links."""
