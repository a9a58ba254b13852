"""What views are given, and what bodies, links and pairs are called in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from overlapper import Overlap, Placed

ROOT = "/overlapper/bodies"
Pair = tuple[str, str]
LinkName = tuple[str, str]  # body and link

# meshcat's tree and its panel look names up in objects, where these are found before any is put there; "<object>" is
# what it calls the drawing at a node.
INHERITED = {"__proto__", "constructor", "hasOwnProperty", "isPrototypeOf", "propertyIsEnumerable", "toLocaleString"}
INHERITED |= {f"__{way}{kind}__" for way in ("define", "lookup") for kind in ("Getter", "Setter")}
INHERITED |= {"toString", "valueOf", "<object>"}


class Bodies(Protocol):
    """What is drawn: shapes in the world by (body, link, shape); the colours of the links and their distinct names."""

    @property
    def keys(self) -> Sequence[tuple[int, int, int]]: ...
    @property
    def placed(self) -> Sequence[Placed]: ...
    @property
    def colors(self) -> Mapping[tuple[int, int], Sequence[float]]: ...
    @property
    def names(self) -> Mapping[tuple[int, int], str]: ...


class Contact(Protocol):
    """A pair of shapes, each by body, link and index within the link, and what they have in common."""

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


def link_names(bodies: Bodies) -> dict[tuple[int, int], tuple[str, str]]:
    """What the tree calls the body and the link: a slash would begin a new level of it."""
    names = {}
    for (body, link), name in bodies.names.items():
        first, _, rest = name.partition("/")
        names[body, link] = _unlike(first or str(body)), _unlike(rest.replace("/", ".") or str(link))
    return names


def _unlike(name: str) -> str:
    """Quoted, where the name would be taken for something that every object of JavaScript has, or for a quoted one."""
    return f"'{name}'" if name in INHERITED or name[:1] == name[-1:] == "'" else name


def body_paths(bodies: Bodies) -> list[str]:
    """`/overlapper/bodies/<body>/<link>/<shape>` of each shape."""
    names = link_names(bodies)
    return [f"{ROOT}/{'/'.join(names[body, link])}/{shape}" for body, link, shape in bodies.keys]


def pairs(bodies: Bodies, contacts: Iterable[Contact]) -> dict[Pair, Overlap]:
    """The overlapping pairs by their names; a link or shape is named only where its body or link has more than one."""
    return {pair: contact.overlap for pair, _, contact in labelled(bodies, contacts)}


def labelled(bodies: Bodies, contacts: Iterable[Contact]) -> Iterator[tuple[Pair, tuple[LinkName, LinkName], Contact]]:
    """The name of each overlapping pair, its bodies and links, and the pair; "" is the link of a body of one."""
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
