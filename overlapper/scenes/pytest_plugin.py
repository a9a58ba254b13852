"""`pytest scenes/` runs scenes and compares them with their expected files, one test per scene.

The package is imported only when a file is found that may be a scene.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from overlapper.scenes.check import Outcome

PROPERTY = "overlapper"
WORDS = {"moved": "has moved", "new": "is new"}


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("overlapper", "scenes of pybullet, guarded by overlapper")
    group.addoption(
        "--overlapper-record", action="store_true", help="write what is expected of scenes anew, budgets kept"
    )
    group.addoption(
        "--overlapper-out",
        default="out",
        metavar="DIR",
        help="where pages of scenes that have moved are written, with before and after (default: out)",
    )


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    if file_path.suffix != ".py" or b"STEPS" not in file_path.read_bytes():
        return None
    from overlapper.scenes.scene import is_scene

    return SceneFile.from_parent(parent, path=file_path) if is_scene(file_path) else None


class SceneFile(pytest.File):
    """A scene file: one test with the same name."""

    def collect(self) -> Iterable[pytest.Item]:
        yield SceneItem.from_parent(self, name=self.path.stem)


class SceneMoved(Exception):
    """A scene differs from its expected file, or had none."""


class SceneItem(pytest.Item):
    """The test runs the scene and compares its geometry, shapes and dynamics with the expected file."""

    def runtest(self) -> None:
        try:
            from overlapper.scenes.check import hold, pages_of
        except ImportError as error:
            pytest.fail(str(error), pytrace=False)
        from overlapper.scenes.scene import SceneError

        pages = self.config.invocation_params.dir / self.config.getoption("overlapper_out")
        try:
            scenes = [item.path for item in self.session.items if isinstance(item, SceneItem)]
            page = pages_of(scenes, pages)[self.path]
            outcome = hold(self.path, page, self.config.getoption("overlapper_record"))
        except SceneError as error:
            pytest.fail(str(error), pytrace=False)
        self._tell(outcome)
        if not outcome.passed:
            again = [f"to accept the change: pytest --overlapper-record {self.nodeid.partition('::')[0]}"]
            lines = [f"the scene {outcome.name} {WORDS[outcome.word]}", *outcome.lines]
            raise SceneMoved("\n".join(lines + again * (outcome.word == "moved")))

    def _tell(self, outcome: Outcome) -> None:
        """Store the outcome for --junitxml and the end of the run, also if tests pass or run in other processes."""
        self.user_properties += outcome.causes.items()
        remarks = [f"note: {note}" for note in outcome.notes] + outcome.lines * (outcome.word == "recorded")
        self.user_properties += [(PROPERTY, f"{outcome.name}: {remark}") for remark in remarks]
        if outcome.page:
            self.user_properties.append(("before and after", str(outcome.page)))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: object = None) -> str:
        return str(excinfo.value if isinstance(excinfo.value, SceneMoved) else super().repr_failure(excinfo))

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, f"scene {self.name}"


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reports = [report for kind in ("passed", "failed") for report in terminalreporter.getreports(kind)]
    remarks = [
        str(value)
        for report in reports
        if report.when == "call"
        for name, value in report.user_properties
        if name == PROPERTY
    ]
    if remarks:
        terminalreporter.section("overlapper")
        for remark in remarks:
            terminalreporter.line(remark)
