"""gradcheck and gradgradcheck of the volume of every two kinds of shapes.

First derivatives are by shape, translation and rotation vector. Second derivatives are by motion alone.
"""

import numpy as np
import pytest
import torch
from pairs_of_kinds import PAIRS, PairOfKinds


class Volume(torch.autograd.Function):
    """The common volume. Its derivatives are those without motion."""

    @staticmethod
    def forward(ctx, pair, *numbers):
        ctx.pair = pair
        return torch.tensor(pair.overlap([each.numpy() for each in numbers]).volume, dtype=torch.float64)

    @staticmethod
    def backward(ctx, upstream):
        return None, *(upstream * torch.from_numpy(row) for row in ctx.pair.gradient())


class VolumeByMotion(torch.autograd.Function):
    """The common volume after motions of both bodies: (2, 6) translations and rotation vectors."""

    @staticmethod
    def forward(ctx, pair, motion):
        ctx.pair = pair
        ctx.save_for_backward(motion)
        return torch.tensor(moved(pair, motion).volume, dtype=torch.float64)

    @staticmethod
    def backward(ctx, upstream):
        return None, upstream * Slope.apply(ctx.pair, *ctx.saved_tensors)


class Slope(torch.autograd.Function):
    """The derivatives of the volume, right to the first order of the motion."""

    @staticmethod
    def forward(ctx, pair, motion):
        ctx.pair = pair
        found = moved(pair, motion).gradient.copy()
        found[:, 3:] -= np.cross(motion.detach().numpy()[:, 3:], found[:, 3:]) / 2
        return torch.from_numpy(found)

    @staticmethod
    def backward(ctx, upstream):
        hessian = torch.from_numpy(moved(ctx.pair, torch.zeros(2, 6)).hessian)
        return None, (hessian @ upstream.ravel()).reshape(2, 6)


def moved(pair, motion):
    numbers = [row.copy() for row in pair.numbers]
    for row, step in zip(numbers, motion.detach().numpy()):
        row[-6:] = step
    return pair.overlap(numbers)


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_gradcheck_of_every_two_kinds_of_shapes(kinds):
    pair = PairOfKinds(kinds, seed=2)
    numbers = [torch.tensor(row, requires_grad=True) for row in pair.numbers]
    assert Volume.apply(pair, *numbers) > 0
    assert torch.autograd.gradcheck(lambda *both: Volume.apply(pair, *both), numbers, eps=1e-5, atol=1e-7, rtol=1e-6)


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_gradgradcheck_of_every_two_kinds_of_shapes_by_motion(kinds):
    pair = PairOfKinds(kinds, seed=2)
    motion = torch.zeros(2, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradgradcheck(
        lambda step: VolumeByMotion.apply(pair, step), motion, eps=1e-6, atol=1e-7, rtol=1e-6
    )
