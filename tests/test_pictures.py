"""Pictures of README and docs are up to date, and the check notices pictures that are not."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))
import pictures  # noqa: E402


def test_pictures_are_as_they_would_be_made():
    done = subprocess.run([sys.executable, ROOT / "docs" / "pictures.py", "--check"], capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("All pictures are as they would be made.\n", 0), done.stderr


def test_every_picture_that_is_shown_has_its_maker():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    shown = [name for page in pages for name in re.findall(r"!\[[^]]*\]\(([^):]+)\)", page.read_text("utf-8"))]
    assert {Path(name).name for name in shown} == {picture for maker in pictures.MAKERS for picture in maker.pictures}


PAGES = sorted(ROOT.glob("docs/*.md"))


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_a_page_names_the_command_that_makes_its_pictures(page):
    """Itself, or by a link to the page that it is from."""
    text = page.read_text("utf-8")
    for picture in re.findall(r"!\[[^]]*\]\(([^):]+)\)", text):
        (command,) = (maker.command.removesuffix(" --page") for maker in pictures.MAKERS if picture in maker.pictures)
        named = rf"(python {re.escape(command)}|overlapper {Path(command.split()[-1]).stem})\b"
        linked = [ROOT / "docs" / name for name in re.findall(r"\]\((\w+\.md)\)", text)]
        assert any(re.search(named, each.read_text("utf-8")) for each in (page, *linked)), picture


@pytest.fixture
def gallery(tmp_path, monkeypatch):
    """One picture, made from a script and a text."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "make.py").write_text("open('docs/a.png', 'w').write(open('text').read())")
    (tmp_path / "text").write_text("what is seen")
    monkeypatch.setattr(pictures, "ROOT", tmp_path)
    monkeypatch.setattr(pictures, "TABLE", tmp_path / "docs" / "pictures.csv")
    monkeypatch.setattr(pictures, "MAKERS", (pictures.Maker("docs/make.py", ("a.png",), ("text",)),))
    return tmp_path


def run(monkeypatch, *options):
    monkeypatch.setattr(sys, "argv", ["pictures.py", *options])
    pictures.main()


def test_only_changed_pictures_are_made_again(gallery, monkeypatch, capfd):
    assert list(pictures.check()) == ["docs/a.png was never made: make pictures"]
    run(monkeypatch)
    assert capfd.readouterr().out == "python docs/make.py\n" and list(pictures.check()) == []
    run(monkeypatch)
    assert capfd.readouterr().out == ""
    run(monkeypatch, "--all")
    assert capfd.readouterr().out == "python docs/make.py\n"
    (gallery / "text").write_text("something else")
    assert list(pictures.check()) == ["docs/a.png is older than what it is made from: make pictures"]
    run(monkeypatch)
    assert (gallery / "docs" / "a.png").read_text() == "something else" and list(pictures.check()) == []
    (gallery / "docs" / "a.png").write_text("by hand")
    assert list(pictures.check()) == ["docs/a.png is not what docs/make.py made: make pictures"]
    with pytest.raises(SystemExit) as ended:
        run(monkeypatch, "--check")
    assert ended.value.code == 1 and "not what docs/make.py made" in capfd.readouterr().out


def test_a_missing_source_is_named(gallery):
    (gallery / "text").unlink()
    with pytest.raises(FileNotFoundError, match=r"^docs/make.py is said to be made from text, which is not there$"):
        list(pictures.check())


def test_line_ends_of_a_checkout_make_no_picture_old(gallery, monkeypatch):
    (gallery / "text").write_bytes(b"one\ntwo\n")
    run(monkeypatch)
    (gallery / "text").write_bytes(b"one\r\ntwo\r\n")
    assert list(pictures.check()) == []
