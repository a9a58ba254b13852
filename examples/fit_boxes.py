"""Sixteen boxes are fitted to sixteen others by gradient descent on 1 - IoU, with the derivatives of overlapper.jax."""

import jax
import jax.numpy as jnp
import numpy as np

from overlapper.jax import Boxes, iou

rng = np.random.default_rng(0)
truth = Boxes(
    sizes=jnp.array(rng.uniform(0.5, 2, (16, 3))),
    positions=jnp.array(rng.uniform(-1, 1, (16, 3))),
    orientations=jnp.array(rng.normal(size=(16, 4))),
)
guess = Boxes(
    sizes=truth.sizes * np.exp(0.2 * rng.normal(size=(16, 3))),
    positions=truth.positions + 0.1 * rng.normal(size=(16, 3)),
    orientations=truth.orientations + 0.1 * rng.normal(size=(16, 4)),
)


@jax.jit
@jax.value_and_grad
def loss(boxes: Boxes) -> jax.Array:
    return (1 - iou(boxes, truth, aligned=True)).sum()


squares = jax.tree.map(jnp.zeros_like, guess)  # RMSprop: each number moves by about the rate
for step in range(301):
    value, slope = loss(guess)
    squares = jax.tree.map(lambda mean, s: 0.9 * mean + 0.1 * s**2, squares, slope)
    guess = jax.tree.map(
        lambda x, s, mean, rate=0.02 * 0.98**step: x - rate * s / (jnp.sqrt(mean) + 1e-9), guess, slope, squares
    )
    if step % 60 == 0:
        print(f"step {step:3}: mean IoU {1 - float(value) / 16:.4f}")
