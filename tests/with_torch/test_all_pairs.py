"""gradcheck of the volume of every two kinds of shapes, by shape, translation and rotation vector."""

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


@pytest.mark.parametrize("kinds", PAIRS, ids=" and ".join)
def test_gradcheck_of_every_two_kinds_of_shapes(kinds):
    pair = PairOfKinds(kinds, seed=2)
    numbers = [torch.tensor(row, requires_grad=True) for row in pair.numbers]
    assert Volume.apply(pair, *numbers) > 0
    assert torch.autograd.gradcheck(lambda *both: Volume.apply(pair, *both), numbers, eps=1e-5, atol=1e-7, rtol=1e-6)
