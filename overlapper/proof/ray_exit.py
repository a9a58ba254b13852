"""Where rays from inside of a placed body leave it: exactly, then rounded towards the inside."""

from __future__ import annotations

import math

import numpy as np

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Sphere
from overlapper.proof.body_planes import BodyPlanes
from overlapper.proof.rational import DOUBT, UNDERFLOW, Exact, bits, exact, in_doubles, integers

integer_root = np.frompyfunc(math.isqrt, 1, 1)


def ray_exits(known: BodyPlanes, start: Exact, arms: Exact, fine: int) -> Exact:
    """Shares (n,) of `arms` (n, 3) along which one gets from `start`, a point inside, without leaving the body.

    The greatest, not above 1, in units of 2^-fine and rounded down.
    """
    body = known.body
    numbers, unit = integers(np.vstack([arms, start - body.position]))
    turn, scale = integers(body.axes)
    local, scale = numbers @ turn, scale * unit
    rays, origin = local[:-1], local[-1]
    one = 1 << fine
    match body.shape:
        case Sphere() as ball:
            (radius,), grow = _in_units(scale, ball.radius)
            shares = _out_of_ball(grow * origin[None], grow * rays, radius, fine)
        case Capsule() as capsule:
            (radius, half), grow = _in_units(scale, capsule.radius, capsule.length / 2)
            shares = _out_of_capsule(grow * origin, grow * rays, radius, half, fine)
        case Cylinder() as cylinder:
            (radius, half), grow = _in_units(scale, cylinder.radius, cylinder.length / 2)
            shares = _out_of_cylinder(grow * origin, grow * rays, radius, half, fine)
        case Ellipsoid() as ellipsoid:
            inverse, grow = integers(1 / exact(ellipsoid.half_axes))
            shares = _out_of_ball((origin * inverse)[None], rays * inverse, scale * grow, fine)
        case Box() | Hull() | HalfSpace():
            shares = _out_of_planes(known.rows, origin, rays, scale, fine)
    least: Exact = np.minimum(shares, one)
    return least


def _in_units(scale: int, *sizes: float) -> tuple[list[int], int]:
    """Sizes in units so small that they are integers, and how many of the units make one of 1 / scale."""
    numbers, grow = integers(exact([*sizes]))
    return [int(x) * scale for x in numbers], grow


def _out_of_ball(start: Exact, arms: Exact, radius: int, fine: int) -> Exact:
    """The greater share at which |start + share * arm| is the radius, in two or three dimensions.

    Of the two usual forms the one that does not cancel.
    """
    inside = radius * radius - (start * start).sum(axis=1)
    along, square = (start * arms).sum(axis=1), (arms * arms).sum(axis=1)
    lower = integer_root(along * along + square * inside)
    forwards = along > 0
    over, under = np.where(forwards, inside, lower - along), np.where(forwards, along + lower + 1, square)
    shares: Exact = (over << fine) // under
    return shares


def _out_of_capsule(origin: Exact, arms: Exact, radius: int, half: int, fine: int) -> Exact:
    """Through the side where that is met between the ends, else through the cap that lies ahead."""
    start = np.repeat(origin[None], len(arms), axis=0)
    shares, past = np.zeros(len(arms), object), arms[:, 2] << fine
    across = (arms[:, :2] != 0).any(axis=1)
    shares[across] = _out_of_ball(start[across, :2], arms[across, :2], radius, fine)
    past[across] = (start[across, 2] << fine) + shares[across] * arms[across, 2]
    cap = ~across | (abs(past) > half << fine)
    start[:, 2] -= np.array([half if z > 0 else -half for z in past], object)
    shares[cap] = _out_of_ball(start[cap], arms[cap], radius, fine)
    return shares


def _out_of_cylinder(origin: Exact, arms: Exact, radius: int, half: int, fine: int) -> Exact:
    rise = arms[:, 2]
    ends = np.array([_share(half - origin[2] if z > 0 else half + origin[2], abs(z), fine) for z in rise], object)
    across = (arms[:, :2] != 0).any(axis=1)
    sides = _out_of_ball(origin[None, :2], arms[across, :2], radius, fine)
    ends[across] = np.minimum(ends[across], sides)
    return ends


def _share(slack: int, along: int, fine: int) -> int:
    """1 where the ray does not get nearer."""
    return (slack << fine) // along if along > 0 else 1 << fine


def _out_of_planes(rows: Exact, origin: Exact, arms: Exact, scale: int, fine: int) -> Exact:
    """Doubles leave a few planes to choose from."""
    slack = rows[:, 3] * scale - rows[:, :3] @ origin
    unit = 1 << bits(arms)
    sizes = [1 << bits(row) for row in rows[:, :3]]
    normals = np.array([in_doubles(row, size) for row, size in zip(rows[:, :3], sizes)])
    slacks = np.array([x / (unit * size) for x, size in zip(slack, sizes)])
    shares = []
    for arm, x in zip(arms, in_doubles(arms, unit)):
        along, doubt = normals @ x, DOUBT * (abs(normals) @ abs(x)) + UNDERFLOW
        with np.errstate(all="ignore"):
            least = np.where(along + doubt > 0, slacks / (along + doubt), np.inf) * (1 - DOUBT)
            most = np.where(along - doubt > 0, slacks / (along - doubt), np.inf) * (1 + DOUBT)
        few = np.flatnonzero((along + doubt > 0) & (least <= most.min()))
        shares.append(min((_share(slack[k], rows[k, :3] @ arm, fine) for k in few), default=1 << fine))
    return np.array(shares, object)
