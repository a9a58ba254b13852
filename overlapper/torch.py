"""Common volumes, IoU and depths of oriented boxes as differentiable functions of torch tensors.

The numbers are computed on the processor in float64. Tensors of a GPU are copied to the processor and back. Results
have the dtype and the device of the sizes of `a`. There are first and second derivatives; by the corners of
`box3d_overlap` and `boxes_of_corners`, there are first derivatives only. A second derivative of a volume is NaN where a
face of one box lies in the plane of a face of the other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from overlapper import _core, box_gradients
from overlapper.arrays import UNIT_CORNERS
from overlapper.install import hint

try:
    import torch
    from torch import Tensor
except ImportError as error:
    raise ImportError(f"overlapper.torch needs {hint('torch')}") from error

__all__ = ["Boxes", "box3d_overlap", "boxes_of_corners", "corners", "depth", "iou", "volume"]


NO_SECOND = "overlapper.torch has first derivatives only by corners"
NO_THIRD = "overlapper.torch has first and second derivatives only"


class Boxes(NamedTuple):
    """Oriented boxes.

    Parameters
    ----------
    sizes : (n, 3) Tensor
        Side lengths along x, y, z of each box, m.
    positions : (n, 3) Tensor
        Centres, m.
    orientations : (n, 4) Tensor
        Quaternions x, y, z, w of any length but 0.
    """

    sizes: Tensor
    positions: Tensor
    orientations: Tensor


def volume(a: Boxes, b: Boxes, *, aligned: bool = False, threads: int | None = 1) -> Tensor:
    """Common volumes of boxes.

    Parameters
    ----------
    a, b : Boxes
        Two sets of boxes.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) Tensor
        Volumes in m³. 0 for pairs that do not overlap; their derivatives are 0.

    Raises
    ------
    ValueError
        If a tensor has the wrong shape, or a row is not finite or not positive.

    Examples
    --------
    >>> import torch
    >>> from overlapper.torch import Boxes, volume
    >>> turned = torch.tensor([[0, 0, 0, 1.0]])
    >>> sizes = torch.full((1, 3), 2.0, requires_grad=True)
    >>> shared = volume(Boxes(sizes, torch.zeros(1, 3), turned), Boxes(sizes, torch.tensor([[1.0, 0, 0]]), turned))
    >>> shared.tolist()
    [[4.0]]
    """
    return _exact(a, b, aligned, threads).to(a[0])


def iou(a: Boxes, b: Boxes, *, aligned: bool = False, threads: int | None = 1) -> Tensor:
    """Intersection over union of boxes: the common volume over the volume of the union.

    Parameters
    ----------
    a, b : Boxes
        Two sets of boxes.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) Tensor
        Ratios from 0 to 1.

    Raises
    ------
    ValueError
        As for `volume`.
    """
    return _ratio(_exact(a, b, aligned, threads), a, b, aligned).to(a[0])


def depth(a: Boxes, b: Boxes, *, aligned: bool = False, threads: int | None = 1) -> Tensor:
    """Penetration depths of boxes: the length of the shortest translation that separates each pair.

    Parameters
    ----------
    a, b : Boxes
        Two sets of boxes.
    aligned : bool, default False
        True for row i of `a` with row i of `b`. False for every row of `a` with every row of `b`.
    threads : int or None, default 1
        Number of threads; None for one per processor.

    Returns
    -------
    (n, m) or (n,) Tensor
        Depths in m. 0 for pairs that do not overlap; their derivatives are 0. Where two directions have the same depth,
        and where an edge or a face is parallel to a face, derivatives are one-sided.

    Raises
    ------
    ValueError
        As for `volume`.

    Examples
    --------
    >>> import torch
    >>> from overlapper.torch import Boxes, depth
    >>> turned = torch.tensor([[0, 0, 0, 1.0]])
    >>> place = torch.tensor([[1.5, 0, 0]], requires_grad=True)
    >>> a, b = (Boxes(torch.full((1, 3), 2.0), at, turned) for at in (place, torch.zeros(1, 3)))
    >>> deep = depth(a, b, aligned=True)
    >>> deep.item(), torch.autograd.grad(deep.sum(), place)[0][0, 0].item()
    (0.5, -1.0)
    """
    six = [each.to("cpu", torch.float64) for each in (*a, *b)]
    found = box_gradients.directions([each.detach().numpy() for each in six], aligned, threads)
    along = box_gradients.Directions(*map(_tensor, found))
    formula = box_gradients.depths(torch, six, along, aligned)
    return (formula + (along.depth - formula).detach()).to(a[0])


def boxes_of_corners(corners: Tensor) -> Boxes:
    """Boxes from their 8 corners, as `overlapper.arrays.boxes_of_corners`.

    Parameters
    ----------
    corners : (n, 8, 3) Tensor
        Corners, m, in the order of pytorch3d. Other orders are sorted.

    Returns
    -------
    Boxes
        The boxes, in float64.

    Raises
    ------
    ValueError
        If the corners are not those of a box.
    """
    return _fit(corners, "corners")


def corners(boxes: Boxes) -> Tensor:
    """The 8 corners of each box, in the order of pytorch3d.

    Parameters
    ----------
    boxes : Boxes
        The boxes.

    Returns
    -------
    (n, 8, 3) Tensor
        Corners, m.
    """
    unit = torch.as_tensor(UNIT_CORNERS).to(boxes.sizes)
    local = unit * boxes.sizes[..., None, :]
    turned = box_gradients.rotations(torch, boxes.orientations)
    return local @ turned.transpose(-1, -2) + boxes.positions[..., None, :]


def box3d_overlap(boxes1: Tensor, boxes2: Tensor, eps: float = 1e-4) -> tuple[Tensor, Tensor]:
    """The volumes and IoUs of `pytorch3d.ops.box3d_overlap`, exact and with derivatives by the corners.

    Parameters
    ----------
    boxes1 : (n, 8, 3) Tensor
        Corners of boxes, m. The order is that of pytorch3d; other orders are sorted.
    boxes2 : (m, 8, 3) Tensor
        Corners of boxes, m.
    eps : float, default 1e-4
        Not used: pytorch3d has a limit here for corners off their plane. `boxes_of_corners` says what is refused.

    Returns
    -------
    vol : (n, m) Tensor
        Common volumes, m³.
    iou : (n, m) Tensor
        Intersection over union.

    Raises
    ------
    ValueError
        If a tensor has the wrong shape, or corners are not those of a box.

    Examples
    --------
    >>> import torch
    >>> from overlapper.torch import box3d_overlap, Boxes, corners
    >>> unit = corners(Boxes(torch.ones(1, 3), torch.zeros(1, 3), torch.tensor([[0, 0, 0, 1.0]])))
    >>> box3d_overlap(unit, unit + torch.tensor([0.5, 0, 0]))[1].tolist()
    [[0.3333333432674408]]
    """
    a, b = _fit(boxes1, "boxes1"), _fit(boxes2, "boxes2")
    shared = _exact(a, b, False, 1)
    return shared.to(boxes1), _ratio(shared, a, b, False).to(boxes1)


def _exact(a: Boxes, b: Boxes, aligned: bool, threads: int | None) -> Tensor:
    """Common volumes in float64 on the processor."""
    shared: Tensor = _Volume.apply(aligned, threads, *(each.to("cpu", torch.float64) for each in (*a, *b)))
    return shared


def _ratio(shared: Tensor, a: Boxes, b: Boxes, aligned: bool) -> Tensor:
    own, other = (each[0].to(shared).prod(-1) for each in (a, b))
    ratio = shared / ((own if aligned else own[..., None]) + (other if aligned else other[..., None, :]) - shared)
    # Rounding may lift the ratio above 1. The derivative stays.
    return ratio - (ratio - 1).clamp(min=0).detach()


def _fit(given: Tensor, name: str) -> Boxes:
    return Boxes(*_Fit.apply(given.to("cpu", torch.float64), name))


def _tensor(numbers: Any) -> Tensor:
    return torch.from_numpy(np.array(numbers))


class _Volume(torch.autograd.Function):  # type: ignore[misc,unused-ignore]
    @staticmethod
    def forward(ctx: Any, aligned: bool, threads: int | None, *six: Tensor) -> Tensor:
        ctx.save_for_backward(*six)
        ctx.how = aligned, threads
        return _tensor(box_gradients.volumes([each.numpy() for each in six], aligned, threads))

    @staticmethod
    def backward(ctx: Any, upstream: Tensor) -> tuple[Any, ...]:
        return None, None, *_Slopes.apply(upstream, ctx.how, *ctx.saved_tensors)


class _Slopes(torch.autograd.Function):  # type: ignore[misc,unused-ignore]
    """First derivatives of a weighted sum."""

    @staticmethod
    def forward(ctx: Any, upstream: Tensor, how: tuple[bool, int | None], *six: Tensor) -> tuple[Tensor, ...]:
        ctx.save_for_backward(upstream, *six)
        ctx.how = how
        found = box_gradients.gradients([each.numpy() for each in six], upstream.numpy(), *how)
        return tuple(map(_tensor, found))

    @staticmethod
    def backward(ctx: Any, *along: Tensor) -> tuple[Any, ...]:
        by_upstream, *by_six = _Bends.apply(ctx.how, *ctx.saved_tensors, *along)
        return by_upstream, None, *by_six


class _Bends(torch.autograd.Function):  # type: ignore[misc,unused-ignore]
    """Second derivatives, whose own derivatives are refused: they would be zero without a word."""

    @staticmethod
    def forward(ctx: Any, how: tuple[bool, int | None], *tensors: Tensor) -> tuple[Tensor, ...]:
        upstream, *arrays = (each.numpy() for each in tensors)
        by_upstream, by_six = box_gradients.second_derivatives(arrays[:6], upstream, arrays[6:], *how)
        return tuple(map(_tensor, (by_upstream, *by_six)))

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor) -> Any:
        raise NotImplementedError(NO_THIRD)


class _Fit(torch.autograd.Function):  # type: ignore[misc,unused-ignore]
    @staticmethod
    def forward(ctx: Any, given: Tensor, name: str) -> tuple[Tensor, Tensor, Tensor]:
        ctx.fitted = _core.fit_boxes(given.numpy(), name)
        ctx.save_for_backward(given)
        sizes, positions, orientations, _ = ctx.fitted
        return _tensor(sizes), _tensor(positions), _tensor(orientations)

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor) -> tuple[Any, None]:
        return _FitSlopes.apply(ctx.fitted, *upstream, *ctx.saved_tensors), None


class _FitSlopes(torch.autograd.Function):  # type: ignore[misc,unused-ignore]
    @staticmethod
    def forward(
        ctx: Any, fitted: Any, by_size: Tensor, by_position: Tensor, by_quaternion: Tensor, _: Tensor
    ) -> Tensor:
        by = (each.numpy() for each in (by_size, by_position, by_quaternion))
        return _tensor(box_gradients.corner_gradients(fitted, *by))

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor) -> Any:
        raise NotImplementedError(NO_SECOND)
