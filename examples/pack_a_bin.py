"""Ten boxes fall into a bin by gradient descent, and push each other apart until nothing overlaps."""

import jax
import jax.numpy as jnp
import numpy as np

from overlapper.jax import Boxes, volume

rng = np.random.default_rng(0)
turns = rng.normal(size=(10, 4))
turns /= np.linalg.norm(turns, axis=1, keepdims=True)
sizes = jnp.array(rng.uniform(0.2, 0.5, (10, 3)))
poses = (jnp.array(rng.uniform((-0.3, -0.3, 0.3), (0.3, 0.3, 1.5), (10, 3))), jnp.array(turns))
inside = Boxes(jnp.array([[1.2, 1.2, 4.0]]), jnp.array([[0.0, 0.0, 2.0]]), jnp.array([[0, 0, 0, 1.0]]))
first, second = np.triu_indices(10, 1)


def wrong(poses: tuple[jax.Array, jax.Array]) -> jax.Array:
    """m³ that two boxes share, or that boxes have outside the bin."""
    boxes = Boxes(sizes, *poses)
    pairs = (Boxes(*(each[rows] for each in boxes)) for rows in (first, second))
    return volume(*pairs, aligned=True).sum() + jnp.prod(sizes, -1).sum() - volume(boxes, inside).sum()


@jax.jit
def step(poses, squares, weight, rate):
    slope = jax.grad(lambda p: wrong(p) + weight * p[0][:, 2].sum())(poses)
    squares = jax.tree.map(lambda mean, s: 0.9 * mean + 0.1 * s**2, squares, slope)
    return jax.tree.map(lambda x, s, m: x - rate * s / (jnp.sqrt(m) + 1e-4), poses, slope, squares), squares


squares = jax.tree.map(jnp.zeros_like, poses)
for k in range(1200):
    weight = 0.02 if k < 800 else 0.0  # gravity, and then only what is wrong
    poses, squares = step(poses, squares, weight, 0.01 * 0.9975**k)
    if k % 200 == 199:
        print(f"step {k + 1:4}: {1e6 * wrong(poses):9.1f} cm³ wrong, mean height {poses[0][:, 2].mean():.3f} m")
