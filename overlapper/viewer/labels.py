"""The bodies and contacts that views are given, and the names of bodies, links and pairs in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from overlapper import Overlap, Placed

ROOT = "/overlapper/bodies"
Pair = tuple[str, str]
LinkName = tuple[str, str]  # body and link
Key = tuple[int, ...]  # bodyA, linkA, shapeA, bodyB, linkB, shapeB

# meshcat's tree and panel look names up in JavaScript objects, which have these names by default. "<object>" is
# meshcat's name for the drawing at a node.
INHERITED = {"__proto__", "constructor", "hasOwnProperty", "isPrototypeOf", "propertyIsEnumerable", "toLocaleString"}
INHERITED |= {f"__{way}{kind}__" for way in ("define", "lookup") for kind in ("Getter", "Setter")}
INHERITED |= {"toString", "valueOf", "<object>"}


class DrawnBodies(Protocol):
    """Shapes in the world by (body, link, shape), and the colours and distinct names of links."""

    @property
    def keys(self) -> Sequence[tuple[int, int, int]]: ...
    @property
    def placed(self) -> Sequence[Placed]: ...
    @property
    def colors(self) -> Mapping[tuple[int, int], Sequence[float]]: ...
    @property
    def names(self) -> Mapping[tuple[int, int], str]: ...


class DrawnContact(Protocol):
    """A pair of shapes, each by body, link and index within the link, and their overlap."""

    @property
    def bodyA(self) -> int: ...
    @property
    def linkA(self) -> int: ...
    @property
    def shapeA(self) -> int: ...
    @property
    def bodyB(self) -> int: ...
    @property
    def linkB(self) -> int: ...
    @property
    def shapeB(self) -> int: ...
    @property
    def overlap(self) -> Overlap: ...


def must_be_drawn(bodies: object, contacts: object) -> None:
    """TypeError unless these are bodies and a list of contacts."""
    if not hasattr(bodies, "placed"):
        raise TypeError(f"bodies must be the Bodies of a simulation, not {bodies!r}")
    if not isinstance(contacts, Iterable):
        raise TypeError(f"contacts must be what Bodies.overlaps() returns, not {contacts!r}")


def link_names(bodies: DrawnBodies) -> dict[tuple[int, int], tuple[str, str]]:
    """The names of body and link in the tree. They have no slashes, as a slash begins a new level."""
    names = {}
    for (body, link), name in bodies.names.items():
        first, _, rest = name.partition("/")
        names[body, link] = _unlike(first or str(body)), _unlike(rest.replace("/", ".") or str(link))
    return names


def _unlike(name: str) -> str:
    """The name, in quotes if JavaScript objects have it by default, or if it begins and ends with a quote."""
    return f"'{name}'" if name in INHERITED or name[:1] == name[-1:] == "'" else name


def body_paths(bodies: DrawnBodies) -> list[str]:
    """The path `/overlapper/bodies/<body>/<link>/<shape>` of each shape."""
    names = link_names(bodies)
    return [f"{ROOT}/{'/'.join(names[body, link])}/{shape}" for body, link, shape in bodies.keys]


def key_of(contact: DrawnContact) -> Key:
    return contact.bodyA, contact.linkA, contact.shapeA, contact.bodyB, contact.linkB, contact.shapeB


def labelled(
    bodies: DrawnBodies, contacts: Iterable[DrawnContact]
) -> Iterator[tuple[Pair, tuple[LinkName, LinkName], DrawnContact]]:
    """The name of each overlapping pair, its bodies and links, and the pair. The link of a body of one link is ""."""
    names = link_names(bodies)
    links = Counter(body for body, _ in names)
    shapes = Counter((body, link) for body, link, _ in bodies.keys)

    def where(body: int, link: int) -> LinkName:
        first, rest = names[body, link]
        return first, rest if links[body] > 1 else ""

    def name(body: int, link: int, shape: int) -> str:
        label = ".".join(filter(None, where(body, link)))
        return f"{label}.{shape}" if shapes[body, link] > 1 else label

    for c in contacts:
        if c.overlap:
            pair = name(c.bodyA, c.linkA, c.shapeA), name(c.bodyB, c.linkB, c.shapeB)
            yield pair, (where(c.bodyA, c.linkA), where(c.bodyB, c.linkB)), c
