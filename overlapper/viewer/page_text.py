"""The text of a page: a filled template, and a policy that allows only the page's own scripts and no loading."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path

# Scripts set styles, dat.gui's among them. A policy cannot tell these styles from foreign ones.
POLICY = (
    "default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; img-src data: blob:; frame-src blob:; "
    "base-uri 'none'; form-action 'none'"
)


def filled(template: Path, texts: Mapping[str, str], frames: str = "") -> str:
    """The template with a text in place of each {{mark}}, and the policy in place of {{policy}}.

    Marks within texts are not replaced. `frames` is a page embedded in this page. Both policies apply to it.
    """
    page = re.sub(r"\{\{(\w+)\}\}", lambda mark: texts.get(mark[1], mark[0]), template.read_text(encoding="utf-8"))
    hashes = dict.fromkeys(_hash(script) for text in (page, frames) for script in _scripts(text))
    # The first {{policy}} is in the head, before any text.
    return page.replace("{{policy}}", POLICY.format(scripts=" ".join(hashes) or "'none'"), 1)


def _scripts(page: str) -> list[str]:
    """The scripts that a browser runs; scripts of another type are data."""
    return re.findall(r'<script(?: type="module")?>(.*?)</script>', page, re.DOTALL)


def _hash(script: str) -> str:
    # A browser hashes scripts with these line ends.
    text = script.replace("\r\n", "\n").replace("\r", "\n")
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def licences(viewer: Path) -> str:
    """The licences of meshcat's viewer, which is in that folder, and of the libraries that are built into it."""
    texts = [f"meshcat\n\n{(viewer / 'LICENSE').read_text(encoding='utf-8')}"]
    for each in json.loads((viewer / "dist" / "main.min.js.THIRD_PARTY_LICENSES.json").read_text(encoding="utf-8")):
        heading = f"{each['name']} {each['version']}, {each['license']}, {each.get('author') or each['repository']}"
        texts.append(f"{heading}\n\n{each.get('licenseText') or ''}")
    # "</" could end the element that holds the text.
    return "\n\n".join(text.strip() for text in texts).replace("</", "< /")
