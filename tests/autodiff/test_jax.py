"""overlapper.jax: derivatives against differences, under jit and vmap."""

import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from box_pairs import general_boxes

from overlapper import Box, Placed, arrays, overlap
from overlapper.jax import Boxes, depth, iou, volume

jax.config.update("jax_disable_most_optimizations", True)  # compiling takes most of the time


@pytest.fixture(autouse=True)
def double_precision():
    with jax.enable_x64(True):
        yield


def boxes(seed, n=6):
    return Boxes(*map(jnp.asarray, general_boxes(np.random.default_rng(seed), n)))


def slopes(function, *boxes):
    """Central differences by every number."""
    leaves, tree = jax.tree.flatten(boxes)
    found = []
    for k, leaf in enumerate(leaves):
        by = np.zeros(leaf.shape)
        for at in np.ndindex(leaf.shape):
            step = np.zeros(leaf.shape)
            step[at] = 1e-6
            moved = [jax.tree.unflatten(tree, [*leaves[:k], leaf + s * step, *leaves[k + 1 :]]) for s in (1, -1)]
            by[at] = (function(*moved[0]) - function(*moved[1])) / 2e-6
        found.append(by)
    return found


@pytest.mark.parametrize("function", [volume, iou, depth])
@pytest.mark.parametrize("aligned", [True, False])
def test_derivatives_against_differences(function, aligned):
    a, b = boxes(1, 3), boxes(2, 3)
    weights = np.random.default_rng(0).normal(size=3 if aligned else (3, 3))

    def total(p, q):
        return (weights * function(p, q, aligned=aligned)).sum()

    differences = slopes(jax.jit(total), a, b)
    for grad in (jax.grad(total, (0, 1)), jax.jit(jax.grad(total, (0, 1)))):
        for found, slope in zip(jax.tree.leaves(grad(a, b)), differences):
            np.testing.assert_allclose(found, slope, atol=1e-7)


@pytest.mark.parametrize("function", [volume, iou, depth])
@pytest.mark.parametrize("aligned", [True, False])
def test_second_derivatives_against_differences(function, aligned):
    a, b = boxes(1, 3), boxes(2, 3)
    weights = np.random.default_rng(0).normal(size=3 if aligned else (3, 3))
    along = jax.tree.map(lambda each: np.random.default_rng(1).normal(size=each.shape), (a, b))

    def slope(p, q):
        """The derivative along a direction; the derivative of it also has that by the weights of the pairs."""
        first = jax.grad(lambda *both: (weights * jnp.tanh(function(*both, aligned=aligned))).sum(), (0, 1))(p, q)
        return sum((x * y).sum() for x, y in zip(jax.tree.leaves(first), jax.tree.leaves(along)))

    differences = slopes(jax.jit(slope), a, b)
    found = jax.jit(jax.grad(slope, (0, 1)))(a, b)
    for each, expected in zip(jax.tree.leaves(found), differences):
        np.testing.assert_allclose(each, expected, atol=1e-6, rtol=1e-6)


def test_second_derivatives_of_stacks_and_of_boxes_apart_or_flush():
    a, b = boxes(1), boxes(2)

    def bend(p, q):
        return jax.jacrev(jax.grad(lambda x: volume(p._replace(positions=x), q, aligned=True)))(p.positions)

    rows = jax.vmap(bend)(a, b)
    for k in range(6):
        first, second = (jax.tree.map(lambda each, k=k: each[k], boxes) for boxes in (a, b))
        single = bend(first, second)
        np.testing.assert_allclose(rows[k], single, rtol=1e-12)
        np.testing.assert_allclose(single, single.T, atol=1e-12)
    assert not jax.vmap(bend)(a, b._replace(positions=b.positions + 100)).any()
    assert jnp.isnan(jax.vmap(bend)(a, a)).all()
    with pytest.raises(ValueError, match="Pure callbacks do not support JVP"):
        jax.grad(lambda x: bend(first._replace(positions=x), second).sum())(first.positions)


def test_values_are_those_of_arrays():
    a, b = boxes(1), boxes(2, 4)
    numbers = [arrays.boxes(*map(np.asarray, each)) for each in (a, b)]
    assert np.array_equal(volume(a, b), arrays.volume(*numbers))
    assert np.array_equal(jax.jit(volume)(a, b), arrays.volume(*numbers))
    np.testing.assert_allclose(iou(a, b), arrays.iou(*numbers), rtol=1e-15)


def test_depths_are_those_of_overlaps_under_jit_and_vmap():
    a, b = boxes(1), boxes(2, 4)
    placed = [[Placed(Box(s / 2), p, q) for s, p, q in zip(*map(np.asarray, rows))] for rows in (a, b)]
    pairs = [[overlap(one, other) for other in placed[1]] for one in placed[0]]
    expected = np.array([[pair.depth for pair in row] for row in pairs])
    every = jax.vmap(lambda p: jax.vmap(lambda q: depth(p, q, aligned=True))(b))(a)
    for found in (depth(a, b), jax.jit(depth)(a, b), every):
        np.testing.assert_allclose(found, expected, atol=1e-15)
    assert (expected > 0).any()
    slope = jax.grad(lambda x: depth(a._replace(positions=x), b).sum())(a.positions)
    normals = [sum((pair.normal for pair in row if pair), np.zeros(3)) for row in pairs]
    np.testing.assert_allclose(slope, -np.array(normals), atol=1e-13)
    single = jax.tree.map(lambda each: each[0], (a, b))

    def of_place(x):
        return depth(single[0]._replace(positions=x), single[1], aligned=True)

    place = single[0].positions
    np.testing.assert_allclose(jax.hessian(of_place)(place), jax.jacrev(jax.grad(of_place))(place), atol=1e-12)
    apart = b._replace(positions=b.positions + 100)
    assert not jax.grad(lambda x: depth(a._replace(sizes=x), apart).sum())(a.sizes).any()


def test_vmap_over_rows_and_over_stacks():
    a, b = boxes(1), boxes(2)
    single = jax.vmap(lambda p, q: volume(p, q, aligned=True))
    assert np.array_equal(single(a, b), volume(a, b, aligned=True))
    every = jax.vmap(lambda p: jax.vmap(lambda q: volume(p, q, aligned=True))(b))(a)
    assert np.array_equal(every, volume(a, b))
    stacks = [
        jax.tree.map(lambda *each: jnp.stack(each), *(boxes(seed) for seed in seeds)) for seeds in ((1, 2), (3, 4))
    ]
    both = jax.vmap(volume)(*stacks)
    assert np.array_equal(both[0], volume(boxes(1), boxes(3))) and np.array_equal(both[1], volume(boxes(2), boxes(4)))
    grad = jax.vmap(jax.grad(lambda p, q: volume(p, q).sum()))(*stacks)
    alone = jax.grad(lambda p, q: volume(p, q).sum())(boxes(2), boxes(4))
    for found, expected in zip(grad, alone):
        assert np.array_equal(found[1], expected)


def test_single_precision_stays_single_precision():
    a, b = (jax.tree.map(lambda each: each.astype(jnp.float32), boxes(seed)) for seed in (1, 2))
    value, slope = jax.value_and_grad(lambda p: iou(p, b, aligned=True).sum())(a)
    assert value.dtype == slope.sizes.dtype == jnp.float32


def test_no_iou_is_above_one():
    a = boxes(7, 50)
    ratio = iou(a, a, aligned=True)
    assert (ratio <= 1).all() and (ratio > 1 - 1e-12).all()


def test_refusals_name_the_argument():
    a, b = boxes(1), boxes(2, 4)
    with pytest.raises(ValueError, match="a and b must have the same number of rows if they are aligned"):
        volume(a, b, aligned=True)
    with pytest.raises(ValueError, match=r"^b must be sizes \(n, 3\)"):
        volume(a, b._replace(orientations=b.orientations[:, :3]))
    # JAX passes the error of a callback on, or wraps it.
    with pytest.raises((ValueError, jax.errors.JaxRuntimeError), match=r"a: sizes\[0\] must be greater than 0"):
        volume(a._replace(sizes=-a.sizes), b)


@pytest.mark.parametrize("library", ["jax", "torch"])
def test_a_missing_library_is_named(library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, f"overlapper.{library}", raising=False)
    with pytest.raises(ImportError, match=f"^overlapper.{library} needs {library}: pip install {library}$"):
        __import__(f"overlapper.{library}")
