"""Common volumes, IoU and depths of oriented boxes as differentiable functions of JAX arrays, under `jit` and `vmap`.

The numbers are computed on the processor in float64 by `jax.pure_callback`. Results have the dtype of the sizes of `a`.
There are first and second derivatives, in reverse mode only: `jax.jacrev(jax.grad(f))`, not `jax.hessian(f)`. A second
derivative of a volume is NaN where a face of one box lies in the plane of a face of the other. Depths have derivatives
in both modes.
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any, NamedTuple

from overlapper import box_gradients
from overlapper.install import hint

try:
    import jax
    import jax.numpy as jnp
except ImportError as error:
    raise ImportError(f"overlapper.jax needs {hint('jax')}") from error

__all__ = ["Boxes", "depth", "iou", "volume"]


class Boxes(NamedTuple):
    """Oriented boxes. A tree of arrays, as JAX transforms take it.

    Parameters
    ----------
    sizes : (n, 3) jax.Array
        Side lengths along x, y, z of each box, m.
    positions : (n, 3) jax.Array
        Centres, m.
    orientations : (n, 4) jax.Array
        Quaternions x, y, z, w of any length but 0.
    """

    sizes: jax.Array
    positions: jax.Array
    orientations: jax.Array


def volume(a: Boxes, b: Boxes, *, aligned: bool = False, threads: int | None = 1) -> jax.Array:
    """Common volumes of boxes.

    Parameters
    ----------
    a, b : Boxes
        Two sets of boxes. Aligned boxes may have any leading dimensions, or none.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) jax.Array
        Volumes in m³. 0 for pairs that do not overlap; their derivatives are 0.

    Raises
    ------
    ValueError
        If an array has the wrong shape, or a row is not finite or not positive. JAX may wrap the error about a row in a
        JaxRuntimeError.

    Examples
    --------
    >>> import jax, jax.numpy as jnp
    >>> from overlapper.jax import Boxes, volume
    >>> a = Boxes(jnp.full(3, 2.0), jnp.zeros(3), jnp.array([0, 0, 0, 1.0]))
    >>> shared = lambda x: volume(a, a._replace(positions=jnp.array([x, 0, 0])), aligned=True)
    >>> jax.value_and_grad(shared)(1.0)
    (Array(4., dtype=float32), Array(-4., dtype=float32, weak_type=True))
    """
    found: jax.Array = _volume(tuple(a), tuple(b), aligned, threads)
    return found


def iou(a: Boxes, b: Boxes, *, aligned: bool = False, threads: int | None = 1) -> jax.Array:
    """Intersection over union of boxes: the common volume over the volume of the union.

    Parameters
    ----------
    a, b : Boxes
        Two sets of boxes. Aligned boxes may have any leading dimensions, or none.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) jax.Array
        Ratios from 0 to 1.

    Raises
    ------
    ValueError
        As for `volume`.
    """
    shared = volume(a, b, aligned=aligned, threads=threads)
    own, other = (jnp.prod(each.sizes, axis=-1) for each in (a, b))
    ratio = shared / ((own if aligned else own[..., None]) + (other if aligned else other[..., None, :]) - shared)
    # Rounding may lift the ratio above 1. The derivative stays.
    return ratio - jax.lax.stop_gradient(jnp.maximum(ratio - 1, 0))


def depth(a: Boxes, b: Boxes, *, aligned: bool = False, threads: int | None = 1) -> jax.Array:
    """Penetration depths of boxes: the length of the shortest translation that separates each pair.

    Parameters
    ----------
    a, b : Boxes
        Two sets of boxes. Aligned boxes may have any leading dimensions, or none.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) jax.Array
        Depths in m. 0 for pairs that do not overlap; their derivatives are 0. Where two directions have the same depth,
        and where an edge or a face is parallel to a face, derivatives are one-sided.

    Raises
    ------
    ValueError
        As for `volume`.

    Examples
    --------
    >>> import jax, jax.numpy as jnp
    >>> from overlapper.jax import Boxes, depth
    >>> a = Boxes(jnp.full(3, 2.0), jnp.zeros(3), jnp.array([0, 0, 0, 1.0]))
    >>> deep = lambda x: depth(a, a._replace(positions=jnp.array([x, 0, 0])), aligned=True)
    >>> jax.value_and_grad(deep)(1.5)
    (Array(0.5, dtype=float32), Array(-1., dtype=float32, weak_type=True))
    """
    found: jax.Array = _depth(a, b, aligned, threads)
    return found


# As one compiled call: in the formula alone, JAX would compile every operation by itself.
@partial(jax.jit, static_argnums=(2, 3))
def _depth(a: Boxes, b: Boxes, aligned: bool, threads: int | None) -> jax.Array:
    six = (*a, *b)
    box_gradients.check(six, aligned)
    shape = a.sizes.shape[:-1] if aligned else (*a.sizes.shape[:-1], b.sizes.shape[-2])
    kind = a.sizes.dtype
    answer = jax.eval_shape(
        lambda: box_gradients.Directions(jnp.empty(shape, kind), *(jnp.empty((*shape, 3), kind) for _ in range(4)))
    )
    given = map(jax.lax.stop_gradient, six)
    along = jax.pure_callback(_directions(aligned, threads), answer, *given, vmap_method="broadcast_all")
    formula = box_gradients.depths(jnp, six, along, aligned)
    found: jax.Array = formula + jax.lax.stop_gradient(along.depth - formula)
    return found


@partial(jax.custom_vjp, nondiff_argnums=(2, 3))
def _volume(a: Any, b: Any, aligned: bool, threads: int | None) -> Any:
    box_gradients.check([*a, *b], aligned)
    shape = a[0].shape[:-1] if aligned else (a[0].shape[-2], b[0].shape[-2])
    answer = jax.eval_shape(lambda: jnp.empty(shape, a[0].dtype))
    return jax.pure_callback(_values(aligned, threads), answer, *a, *b, vmap_method="broadcast_all")


def _forward(a: Any, b: Any, aligned: bool, threads: int | None) -> Any:
    return _volume(a, b, aligned, threads), (a, b)


def _backward(aligned: bool, threads: int | None, kept: Any, upstream: Any) -> Any:
    found = _gradients(upstream, (*kept[0], *kept[1]), aligned, threads)
    return tuple(found[:3]), tuple(found[3:])


_volume.defvjp(_forward, _backward)


@partial(jax.custom_vjp, nondiff_argnums=(2, 3))
def _gradients(upstream: Any, six: Any, aligned: bool, threads: int | None) -> Any:
    answer = jax.eval_shape(lambda: tuple(jnp.empty(each.shape, each.dtype) for each in six))
    return jax.pure_callback(_slopes(aligned, threads), answer, upstream, *six, vmap_method="broadcast_all")


def _gradients_forward(upstream: Any, six: Any, aligned: bool, threads: int | None) -> Any:
    return _gradients(upstream, six, aligned, threads), (upstream, six)


def _gradients_backward(aligned: bool, threads: int | None, kept: Any, along: Any) -> Any:
    upstream, six = kept
    answer = jax.eval_shape(lambda: tuple(jnp.empty(each.shape, each.dtype) for each in (upstream, *six)))
    # The callback has no derivatives of its own, so JAX refuses a third derivative.
    found = jax.pure_callback(_bends(aligned, threads), answer, upstream, *six, *along, vmap_method="broadcast_all")
    return found[0], tuple(found[1:])


_gradients.defvjp(_gradients_forward, _gradients_backward)


# JAX compiles a call anew for every new function, so the functions are kept.


@cache
def _values(aligned: bool, threads: int | None) -> Any:
    def compute(*six: Any) -> Any:
        return box_gradients.volumes(six, aligned, threads).astype(six[0].dtype)

    return compute


@cache
def _slopes(aligned: bool, threads: int | None) -> Any:
    def compute(weights: Any, *six: Any) -> Any:
        found = box_gradients.gradients(six, weights, aligned, threads)
        return tuple(each.astype(given.dtype) for each, given in zip(found, six))

    return compute


@cache
def _bends(aligned: bool, threads: int | None) -> Any:
    def compute(weights: Any, *twelve: Any) -> Any:
        by_weights, by_six = box_gradients.second_derivatives(twelve[:6], weights, twelve[6:], aligned, threads)
        return tuple(each.astype(given.dtype) for each, given in zip((by_weights, *by_six), (weights, *twelve)))

    return compute


@cache
def _directions(aligned: bool, threads: int | None) -> Any:
    def compute(*six: Any) -> Any:
        found = box_gradients.directions(six, aligned, threads)
        return box_gradients.Directions(*(each.astype(six[0].dtype) for each in found))

    return compute
