"""The bodies and contacts that views are given, and the names of bodies, links and pairs in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from overlapper import Overlap, Placed

ROOT = "/overlapper/bodies"
Pair = tuple[str, str]
LinkName = tuple[str, str]  # names of a body and of its link, as in tables
Key = tuple[int, ...]  # bodyA, linkA, shapeA, bodyB, linkB, shapeB

# meshcat's tree and panel look names up in JavaScript objects, which have these names by default. "<object>" is
# meshcat's name for the drawing at a node.
INHERITED = {"__proto__", "constructor", "hasOwnProperty", "isPrototypeOf", "propertyIsEnumerable", "toLocaleString"}
INHERITED |= {f"__{way}{kind}__" for way in ("define", "lookup") for kind in ("Getter", "Setter")}
INHERITED |= {"toString", "valueOf", "<object>"}


class DrawnBodies(Protocol):
    """Shapes in the world by (body, link, shape), colours and distinct names of links, and labels of bodies.

    The name of a link may begin with the label of its body and a slash.
    """

    @property
    def keys(self) -> Sequence[tuple[int, int, int]]: ...
    @property
    def placed(self) -> Sequence[Placed]: ...
    @property
    def colors(self) -> Mapping[tuple[int, int], Sequence[float]]: ...
    @property
    def names(self) -> Mapping[tuple[int, int], str]: ...
    @property
    def labels(self) -> Mapping[int, str]: ...


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


class Met(Protocol):
    """Two links, and whether they passed through each other between two steps."""

    @property
    def bodyA(self) -> int: ...
    @property
    def linkA(self) -> int: ...
    @property
    def bodyB(self) -> int: ...
    @property
    def linkB(self) -> int: ...
    @property
    def tunnelled(self) -> bool: ...


def must_be_drawn(bodies: object, contacts: object) -> None:
    """TypeError unless these are bodies and a list of contacts."""
    if not hasattr(bodies, "placed"):
        raise TypeError(f"bodies must be the Bodies of a simulation, not {bodies!r}")
    if not isinstance(contacts, Iterable):
        raise TypeError(f"contacts must be what Bodies.overlaps() returns, not {contacts!r}")


def own_names(bodies: DrawnBodies) -> dict[tuple[int, int], tuple[str, str]]:
    """The label of the body of each link, and the name of the link without that label."""
    names = {}
    for (body, link), name in bodies.names.items():
        label, unnamed = bodies.labels[body], "base" if link < 0 else str(link)
        names[body, link] = label, unnamed if name == label else name.removeprefix(f"{label}/")
    return names


def in_tree(name: str) -> str:
    """The name as that of a node. A slash would begin a new level of the tree, so U+2215 replaces it.

    Names that JavaScript objects have by default are in quotes, and names that begin and end with a quote.
    """
    name = name.replace("/", "\u2215")
    return f"'{name}'" if name in INHERITED or name[:1] == name[-1:] == "'" else name


def body_paths(bodies: DrawnBodies) -> list[str]:
    """The path `/overlapper/bodies/<body>/<link>/<shape>` of each shape."""
    names = {link: "/".join(map(in_tree, own)) for link, own in own_names(bodies).items()}
    return [f"{ROOT}/{names[body, link]}/{shape}" for body, link, shape in bodies.keys]


def key_of(contact: DrawnContact) -> Key:
    return contact.bodyA, contact.linkA, contact.shapeA, contact.bodyB, contact.linkB, contact.shapeB


def labelled(
    bodies: DrawnBodies, contacts: Iterable[DrawnContact]
) -> Iterator[tuple[Pair, tuple[LinkName, LinkName], DrawnContact]]:
    """The names of each overlapping pair, its bodies and links, and the pair.

    The names are those of the links. A shape has its number behind a dot if the link has several shapes.
    """
    names, labels = bodies.names, bodies.labels
    shapes = Counter((body, link) for body, link, _ in bodies.keys)

    def name(body: int, link: int, shape: int) -> str:
        return f"{names[body, link]}.{shape}" if shapes[body, link] > 1 else names[body, link]

    for c in contacts:
        if c.overlap:
            pair = name(c.bodyA, c.linkA, c.shapeA), name(c.bodyB, c.linkB, c.shapeB)
            links = (labels[c.bodyA], names[c.bodyA, c.linkA]), (labels[c.bodyB], names[c.bodyB, c.linkB])
            yield pair, links, c
