"""overlapper.torch: gradcheck of all arguments, and the results of pytorch3d's function for its published cases.

These tests need torch. They have a target of their own, `make test-torch`.
"""

import doctest

import numpy as np
import pytest
import torch
from box_pairs import general_boxes

import overlapper.torch
from overlapper import Box, Placed, arrays, overlap
from overlapper.torch import Boxes, box3d_overlap, boxes_of_corners, corners, depth, iou, volume

N = 12


def boxes(seed, n=N, dtype=torch.float64):
    numbers = general_boxes(np.random.default_rng(seed), n)
    return Boxes(*(torch.tensor(each, dtype=dtype, requires_grad=True) for each in numbers))


def checked(function, *tensors):
    return torch.autograd.gradcheck(function, tensors, eps=1e-6, atol=1e-6, rtol=1e-5)


@pytest.mark.parametrize("function", [volume, iou, depth])
@pytest.mark.parametrize("aligned", [True, False])
def test_gradcheck_by_size_position_and_quaternion(function, aligned):
    a, b = boxes(1), boxes(2, N if aligned else 5)
    assert checked(lambda *six: function(Boxes(*six[:3]), Boxes(*six[3:]), aligned=aligned), *a, *b)


def test_gradcheck_by_corners():
    a, b = (corners(boxes(seed, 6)).detach() for seed in (3, 4))
    rng = np.random.default_rng(0)
    for order in (np.arange(8), rng.permutation(8)):
        given = [each[:, order].clone().requires_grad_() for each in (a, b)]
        assert checked(lambda *two: box3d_overlap(*two), *given)
    flipped = a[:, [4, 5, 6, 7, 0, 1, 2, 3]].clone().requires_grad_()
    assert checked(lambda each: box3d_overlap(each, b)[1], flipped)


def test_gradcheck_of_the_fitted_box():
    given = corners(boxes(5, 6)).detach().requires_grad_()
    assert checked(lambda each: tuple(boxes_of_corners(each)), given)
    made = boxes_of_corners(given)
    assert torch.allclose(corners(made), given, atol=1e-14)


def test_values_are_those_of_arrays():
    a, b = boxes(1), boxes(2, 7)
    numbers = [arrays.boxes(*(each.detach().numpy() for each in rows)) for rows in (a, b)]
    assert volume(a, b).detach().numpy().tolist() == arrays.volume(*numbers).tolist()
    assert volume(a, b, threads=None).equal(volume(a, b))
    assert np.abs(iou(a, b).detach().numpy() - arrays.iou(*numbers)).max() < 1e-15
    assert volume(a, a, aligned=True).equal(volume(a, a).diagonal())


def edges_to_edges(n):
    """Pairs of boxes that separate along the cross product of two edges."""
    rng, found = np.random.default_rng(3), []
    while len(found) < n:
        numbers = general_boxes(rng, 2)
        pair = overlap(*(Placed(Box(size / 2), at, turn) for size, at, turn in zip(*numbers)))
        axes = np.hstack(list(arrays.boxes(*numbers).rotations))
        if pair and abs(pair.normal @ axes).max() < 0.999:
            found.append(numbers)
    columns = [np.stack([numbers[k] for numbers in found]) for k in range(3)]
    return [Boxes(*(torch.tensor(column[:, body], requires_grad=True) for column in columns)) for body in (0, 1)]


def test_gradcheck_of_the_depth_between_edges():
    a, b = edges_to_edges(4)

    def deep(*six):
        return depth(Boxes(*six[:3]), Boxes(*six[3:]), aligned=True)

    assert (deep(*a, *b) > 0).all()
    assert checked(deep, *a, *b) and torch.autograd.gradgradcheck(deep, (*a, *b), eps=1e-6, atol=1e-5)


def test_depths_are_those_of_overlaps_and_move_along_their_normals():
    a, b = boxes(1), boxes(2, 7)
    found = depth(a, b)
    (slope,) = torch.autograd.grad(found.sum(), a.positions)
    placed = [
        [Placed(Box(s / 2), p, q) for s, p, q in zip(*(each.detach().numpy() for each in rows))] for rows in (a, b)
    ]
    pairs = [[overlap(one, other) for other in placed[1]] for one in placed[0]]
    assert np.abs(found.detach().numpy() - [[pair.depth for pair in row] for row in pairs]).max() <= 1e-15
    normals = [sum((pair.normal for pair in row if pair), np.zeros(3)) for row in pairs]
    assert np.abs(slope.numpy() + normals).max() < 1e-13 and slope.any()
    apart = depth(a, b._replace(positions=b.positions + 100))
    assert not apart.any() and not torch.autograd.grad(apart.sum(), a.sizes)[0].any()
    assert depth(a, Boxes(*(each[:0] for each in b))).shape == (N, 0)
    single = depth(*(Boxes(*(each.detach().float() for each in rows)) for rows in (a, b)))
    assert single.dtype == torch.float32 and torch.allclose(single.double(), found, atol=1e-6)


def test_single_precision_stays_single_precision():
    a, b = boxes(1, dtype=torch.float32), boxes(2, dtype=torch.float32)
    found = iou(a, b, aligned=True)
    found.sum().backward()
    assert found.dtype == a.sizes.grad.dtype == torch.float32
    double = iou(*(Boxes(*(each.detach().double() for each in rows)) for rows in (a, b)), aligned=True)
    assert torch.allclose(found.double(), double, rtol=1e-6)


def test_the_signature_and_results_of_pytorch3d():
    unit = torch.tensor([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
    shifted = torch.stack([unit + torch.tensor([0.5, 0.5, 0]), unit, unit + 5])
    vol, ratio = box3d_overlap(boxes1=unit[None], boxes2=shifted, eps=1e-4)
    assert vol.shape == ratio.shape == (1, 3) and vol.dtype == torch.float32
    assert torch.allclose(vol, torch.tensor([[0.25, 1, 0]])) and torch.allclose(ratio, torch.tensor([[1 / 7, 1, 0]]))
    far = unit + torch.tensor([-24931.9805, 40325.3438, -254.5391])
    assert box3d_overlap(far[None], far[None])[1].item() == pytest.approx(1, abs=1e-6)
    assert box3d_overlap(unit[None], unit[None][:0])[0].shape == (1, 0)


def test_no_iou_is_above_one_and_its_derivative_is_finite():
    a = boxes(7, 50)
    ratio = iou(a, Boxes(*(each.detach() for each in a)), aligned=True)
    assert (ratio <= 1).all() and (ratio > 1 - 1e-12).all()
    ratio.sum().backward()
    assert all(each.grad.isfinite().all() for each in a)


def test_boxes_that_are_apart_have_the_derivative_zero():
    a, b = boxes(1), boxes(2)
    volume(a, b._replace(positions=b.positions + 100)).sum().backward()
    assert not any(each.grad.any() for each in a)


@pytest.mark.parametrize("function", [volume, iou, depth])
@pytest.mark.parametrize("aligned", [True, False])
def test_gradgradcheck_by_size_position_and_quaternion(function, aligned):
    a, b = boxes(1, 4), boxes(2, 4 if aligned else 2)
    assert torch.autograd.gradgradcheck(
        lambda *six: function(Boxes(*six[:3]), Boxes(*six[3:]), aligned=aligned), (*a, *b), eps=1e-6, atol=1e-5
    )


def test_second_derivatives_of_boxes_that_are_apart_or_flush():
    a = boxes(1, 3)
    apart = Boxes(*(each.detach() for each in a))._replace(positions=a.positions.detach() + 100)
    for other, expected in ((apart, 0.0), (Boxes(*(each.detach() for each in a)), torch.nan)):
        (slope,) = torch.autograd.grad(volume(a, other, aligned=True).sum(), a.positions, create_graph=True)
        assert slope.isfinite().all()
        (bend,) = torch.autograd.grad(slope.sum(), a.positions)
        assert torch.equal(bend.nan_to_num(7), torch.full((3, 3), expected, dtype=torch.float64).nan_to_num(7))


def test_derivatives_beyond_the_second_and_by_corners_beyond_the_first_are_refused():
    a, b = boxes(1), boxes(2)
    (slope,) = torch.autograd.grad(volume(a, b).sum(), a.sizes, create_graph=True)
    (bend,) = torch.autograd.grad(slope.sum(), a.sizes, create_graph=True)
    with pytest.raises(NotImplementedError, match=r"^overlapper\.torch has first and second derivatives only$"):
        bend.sum().backward()
    given = corners(a).detach().requires_grad_()
    shared = box3d_overlap(given, corners(b).detach())[0]
    (slope,) = torch.autograd.grad(shared.sum(), given, create_graph=True)
    with pytest.raises(NotImplementedError, match=r"^overlapper\.torch has first derivatives only by corners$"):
        slope.sum().backward()


def test_boxes_are_fitted_to_boxes():
    rng = np.random.default_rng(0)
    target = Boxes(*(each.detach() for each in boxes(9, 16)))
    noise = (0.15, 0.15, 0.1)
    found = Boxes(*((t + s * torch.tensor(rng.normal(size=t.shape))).requires_grad_() for t, s in zip(target, noise)))
    optimizer = torch.optim.Adam(found, 2e-2)
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, 0.98)
    losses = []
    for _ in range(250):
        optimizer.zero_grad()
        loss = (1 - iou(found, target, aligned=True)).mean()
        loss.backward()
        optimizer.step()
        schedule.step()
        losses.append(loss.item())
    assert losses[0] > 0.1 and losses[-1] < 0.02


def test_refusals_name_the_argument():
    a, b = boxes(1), boxes(2)
    with pytest.raises(ValueError, match=r"^b: sizes\[0\] must be greater than 0"):
        volume(a, b._replace(sizes=-b.sizes))
    with pytest.raises(ValueError, match=r"^a must be sizes \(n, 3\)"):
        volume(a._replace(sizes=a.sizes[:, :2]), b)
    with pytest.raises(ValueError, match=r"^boxes2 must be an array of numbers of shape \(n, 8, 3\)"):
        box3d_overlap(corners(a), corners(b)[:, :7])


def test_examples():
    found = doctest.testmod(overlapper.torch)
    assert found.attempted > 5 and not found.failed
