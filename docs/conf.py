"""The site: `make docs` writes it to build/docs. Pages are those that are read in the repository, as they are."""

import html
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

from sphinx.ext.napoleon import Config, NumpyDocstring

from overlapper import Shape, __version__

DOCS = Path(__file__).parent
ROOT = DOCS.parent

project = "overlapper"
author = "overlapper developers"
copyright = "2026, overlapper developers"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.linkcode"]
html_theme = "furo"
html_title = f"overlapper {release}"
html_copy_source = False
html_show_sourcelink = False
myst_heading_anchors = 4
autodoc_default_options = {"members": True, "undoc-members": True, "member-order": "bysource"}
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_mock_imports = ["torch"]  # gigabytes
python_maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"

# Where files that are no page are to be read, as https://host/owner/name/blob/commit. A site that is built at home
# links to the files beside it.
repository = os.environ.get("OVERLAPPER_REPOSITORY", "")

# Types in the sections of docstrings are words, such as "(n, 3) array_like", and not links.
SECTIONS = Config(napoleon_use_param=False, napoleon_use_rtype=False)

LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|!\[[^\]]*\]\([^)]*\))+)\]\(([^()\s]+)\)")
FENCED = re.compile(r"^(```.*?^```$)", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"(`+[^`]+`+)")
NUMBERED = re.compile(r"^\d+\. ``.*``$")
KIND = rf"\b(?:{'|'.join(kind.__name__ for kind in get_args(Shape))})\b"
ALL_KINDS = re.compile(rf"{KIND}(?: \| {KIND}){{{len(get_args(Shape)) - 1}}}")


def in_repository(path, page):
    """Where a file of the repository is read from a page of the site."""
    return f"{repository or os.path.relpath(ROOT, ROOT / 'build/docs' / Path(page).parent)}/{path}"


def mapped(text, base, page):
    """Markdown of a file in the folder `base` as that of a page, with links to what is no page led to where it is."""

    def target(match):
        words, link = match.groups()
        if re.match(r"[a-z]+:|#", link):
            return match[0]
        path, _, anchor = link.partition("#")
        file = (base / path).resolve()
        if not file.exists():
            raise FileNotFoundError(f"{page} links to {link}, which does not exist")
        if file.suffix == ".md" and file.is_relative_to(DOCS):
            return f"[{words}]({os.path.relpath(file, DOCS / Path(page).parent)}{anchor and '#' + anchor})"
        return f'<a href="{in_repository(file.relative_to(ROOT), page)}{anchor and "#" + anchor}">{words}</a>'

    parts = FENCED.split(text)
    parts[::2] = (LINK.sub(target, part) for part in parts[::2])
    text = "".join(parts)
    return text.replace("](docs/", "](") if base == ROOT else text


def read_source(app, docname, source):
    """The first page is the README, with the contents of the site below it; that of the commands is their own words."""
    source[0] = mapped(source[0], (DOCS / docname).parent, docname)
    if docname == "reference/commands":
        source[0] += commands()
    if docname == "index":
        source[0] = mapped((ROOT / "README.md").read_text(encoding="utf-8"), ROOT, docname) + source[0]


def commands():
    """The --help text of every command, as Markdown below the title of a page."""
    command = [sys.executable, "-m", "typer", "overlapper.cli.app", "utils", "docs", "--name", "overlapper"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    said = re.sub(r'<span style="font-weight: bold">(.*?)</span>', r"`\1`", said)
    return html.unescape(said.partition("\n")[2])


def as_rst(lines):
    """Docstrings are plain text with `code` and examples; to reStructuredText, other characters mean something."""
    written, paragraphs = [], "\n".join(lines).strip("\n").split("\n\n")
    for paragraph in paragraphs:
        if paragraph.startswith(">>>"):
            written.append(paragraph)
            continue
        if paragraph.startswith("    "):
            within = written and written[-1].startswith("    ")
            written.append(paragraph if within else ".. code-block:: python\n\n" + paragraph)
            continue
        parts = CODE.split(paragraph)
        parts[::2] = (re.sub(r"([\\*|])|_(?!\w)", r"\\\g<0>", part) for part in parts[::2])
        for i in range(
            1, len(parts), 2
        ):  # what is escaped between code and a letter keeps them apart, and is not shown
            parts[i] = "``" + parts[i].strip("`") + "``" + "\\ " * bool(re.match(r"\w", parts[i + 1]))
        written.append("".join(parts))
    return "\n\n".join(written).split("\n")


def process_docstring(app, what, name, obj, options, lines):
    kept = [line for line in lines if line != "Overloaded function." and not NUMBERED.match(line)]
    written = as_rst(kept)
    if what not in ("attribute", "property"):  # the first colon of these would be taken for the end of a type
        written = NumpyDocstring(written, SECTIONS, app, what, name, obj, options).lines()
    lines[:] = [*written, ""]


def process_signature(app, what, name, obj, options, signature, returned):
    """Types as the modules of the core name them, in the short words of the reference."""

    def short(text):
        if text is None:
            return None
        text = ALL_KINDS.sub("Shape", text)
        text = re.sub(
            r"Annotated\[NDArray\[(?:numpy\.)?(\w+)\], dict\([^()]*(?:\([^()]*\)[^()]*)*\)\]", r"NDArray[\1]", text
        )
        return re.sub(r"\b(?:numpy\.typing|typing|collections\.abc|overlapper\._core|numpy)\.", "", text)

    return short(signature), short(returned)


def linkcode_resolve(domain, info):
    """The line of a name's source; for the core, that which binds it."""
    if not info["module"]:
        return None
    found = sys.modules.get(info["module"])
    for part in info["fullname"].split("."):
        found = getattr(found, part, None)
    found = inspect.unwrap(found.fget if isinstance(found, property) and found.fget else found)
    page = "reference/x"
    try:
        file, line = inspect.getsourcefile(found), inspect.getsourcelines(found)[1]
    except (TypeError, OSError):
        bound = re.compile(rf'(?:class_<[^;{{}}]*?|\bm\.def\()\s*"{info["fullname"].split(".")[0]}"')
        for source in sorted((ROOT / "overlapper/native/python").glob("*.cpp")):
            text = source.read_text(encoding="utf-8")
            if match := bound.search(text):
                line = text.count("\n", 0, match.end()) + 1
                return f"{in_repository(source.relative_to(ROOT), page)}#L{line}"
        return None
    if not file or not Path(file).is_relative_to(ROOT / "overlapper"):
        return None
    return f"{in_repository(Path(file).relative_to(ROOT), page)}#L{line}"


def setup(app):
    app.connect("source-read", read_source)
    app.connect("autodoc-process-docstring", process_docstring)
    app.connect("autodoc-process-signature", process_signature)
