"""Which small faults of the package its tests notice: `make mutants`.

A mutant is the core, or with `--python` the package, with one operator or constant changed: + for -, < for <=, && for
||, min for max, no ! and so on. A seed draws some of them. Mutants of the core are built all at once in a copy of the
tree under build/mutants, each behind its number, and shown to the tests of the core one by one. The recorded answers
come first, as they notice most mutants within seconds. The tests of the mutant's folder follow, and then all tests of
the core. Mutants of forces/ are shown to the tests of forces alone, as no other native test reaches them. A mutant of
Python is shown to the tests of its folder, and then to all tests but those of the core.

A mutant that no test notices is either equivalent, and then named in EQUIVALENT with the reason, or a test is missing.
Results are kept in build/mutants and not asked for again, so that a run goes on where it ended; `--again` shows the
survivors once more. The last lines say which mutants and tests were left out.
"""

from __future__ import annotations

import argparse
import csv
import io
import keyword
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tokenize
import venv
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from overlapper import _core

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build" / "mutants"
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.csv")
NATIVE = "overlapper/native/"
NOT_THE_CORE = ("python/", "fuzz/")
PATIENCE = 10  # seconds that pass for one of processor time: others may use the machine, and a mutant may wait for ever
SLOWER = 5  # times the processor time of the first tests without a mutant, after which a mutant counts as endless
LEAST_SECONDS, MOST_SECONDS = 30, 900  # of processor time; the latter for tests that are not timed without a mutant
ADDRESS_SPACE = 6 << 30  # bytes: a mutant may ask for memory without end

SWAPS = {
    "+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "<": "<=", "<=": "<",
    ">": ">=", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&", "min": "max", "max": "min", "true": "false",
    "false": "true", "0": "1", "1": "0", "2": "3", "3": "2", "4": "8", "8": "4", "16": "64", "1.0": "2.0",
    "0.5": "0.25", "2.0": "1.0",
}  # fmt: skip
# Binary operators have a space on both sides, as clang-format writes them; brackets of templates have none.
TOKEN = re.compile(
    r"""(?P<skip>//.*|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')
    |(?<=\s)(?P<binary>[-+*/]=?|[<>]=?|[=!]=|&&|\|\|)(?=\s)
    |(?P<unary>(?<=[-+*/<>=&|,?:]\s)[-!](?=[\w(])|(?<=[(\[{])[-!](?=[\w(])|(?<=return\s)[-!](?=[\w(]))
    |\b(?P<word>min|max|true|false)\b
    |(?<![\w.<])(?P<constant>\d+\.\d+|\d+)(?![\w.>])""",
    re.VERBOSE,
)
NOT_RUN = re.compile(r"^\s*(#|assert\(|static_assert|throw |using |template|///|\*|case )")

WORDS = {"and": "or", "or": "and", "True": "False", "False": "True", "min": "max", "max": "min", "any": "all",
         "all": "any", "not": ""}  # fmt: skip
NOT_RUN_IN_PYTHON = re.compile(r"^\s*(import |from |@|raise |def |class )")

# Tests that such faults cannot change: those of the stub, memory, signals and of this file.
LEFT_OUT = ("test_stub.py", "test_out_of_memory.py", "test_mutants.py")
NOT_ASKED = "not memory and not ctrl_c and not spawn and not process"
QUICK = "tests/native/test_recorded_answers.py"
NOT_OF_PYTHON = ("__pycache__", "benchmarks", "fuzz", "native", "support")
OF_FORCES = ["tests/native/forces", "tests/native/python/test_contact_solver.py"]


@dataclass(frozen=True)
class Mutant:
    file: str  # below the native folder; of Python, below the package
    line: int  # from 0
    before: str  # the line
    start: int  # of what is changed in it
    end: int
    new: str

    @property
    def after(self) -> str:
        return self.before[: self.start] + self.new + self.before[self.end :]

    @property
    def stages(self) -> list[list[str]]:
        """The tests that may notice it, those that are likely to first: tests mirror the folders of the package."""
        folder = self.file.split("/")[0]
        if self.file.endswith(".py"):
            own = f"tests/{folder}" if "/" in self.file else f"tests/test_{folder}"
            folders = sorted(path.name for path in (ROOT / "tests").iterdir() if path.is_dir())
            stages = [[own], [f"tests/{name}" for name in folders if name not in (folder, *NOT_OF_PYTHON)]]
        elif folder == "forces":
            stages = [OF_FORCES]
        else:
            own = f"tests/native/{folder}"
            stages = [[QUICK], [own], ["tests/native", f"--ignore={QUICK}", f"--ignore={own}"]]
        return [stage for stage in stages if (ROOT / stage[0]).exists()]

    @property
    def name(self) -> tuple[str, str, str]:
        """The mutant without its line number and the line's comment, which change with the file."""
        return self.file, code_of(self.before), code_of(self.after)


def code_of(line: str) -> str:
    return re.split(r" //|  # ", line)[0].strip()


def mutants_of(file: str, text: str) -> list[Mutant]:
    found = []
    for number, line in enumerate(text.splitlines()):
        if NOT_RUN.match(line):
            continue
        for token in TOKEN.finditer(line):
            old = token.group()
            if token["skip"] or (token["constant"] and old not in SWAPS):
                continue
            new = "" if token["unary"] else SWAPS[old]
            found.append(Mutant(file, number, line, token.start(), token.end(), new))
    return found


def mutants_of_python(file: str, text: str) -> list[Mutant]:
    found, lines = [], text.split("\n")
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    for before, token, after in zip(tokens, tokens[1:], tokens[2:]):
        (row, start), (_, end), line = token.start, token.end, lines[token.start[0] - 1 : token.start[0]]
        if not line or NOT_RUN_IN_PYTHON.match(line[0]) or tokenize.STRING in (before.type, after.type):
            continue
        spaced = line[0][:start].endswith(" ") and line[0][end:].startswith(" ")
        new = None
        if token.type == tokenize.NAME:
            new = WORDS.get(token.string)
        elif token.type == tokenize.NUMBER or spaced:
            new = SWAPS.get(token.string)
        elif token.string == "-" and (before.string in "([{=,:<>+-*/" or keyword.iskeyword(before.string)):
            new = ""
        if new is not None:
            found.append(Mutant(file, row - 1, line[0], start, end, new))
    return found


def all_mutants(python: bool = False) -> list[Mutant]:
    folder, kinds, find = ROOT / NATIVE, (".cpp", ".h"), mutants_of
    if python:
        folder, kinds, find = ROOT / "overlapper", (".py",), mutants_of_python
    files = sorted(path for path in folder.rglob("*") if path.suffix in kinds)
    names = [path.relative_to(folder).as_posix() for path in files]
    return [
        mutant
        for name, path in zip(names, files)
        if not name.startswith(NOT_THE_CORE)
        for mutant in find(name, path.read_text())
    ]


def known_equivalent() -> dict[tuple[str, str, str], str]:
    """Those that cannot be told from the core, each with the reason."""
    with EQUIVALENT.open(newline="") as lines:
        return {(row["file"], row["before"], row["after"]): row["reason"] for row in csv.DictReader(lines)}


# All mutants are in one build: where one changes an expression, the expression is chosen by this number.
SWITCH = """#pragma once
#include <cstdlib>
inline const int overlapper_mutant = std::getenv("OVERLAPPER_MUTANT") ? std::atoi(std::getenv("OVERLAPPER_MUTANT")) : 0;
"""
OPENING, CLOSING = "([{", ")]}"


def expression_around(text: str, start: int, end: int) -> tuple[int, int]:
    """The begin and end of the whole expression around an operator or constant at start:end."""
    depth, left = 0, start
    while left > 0:
        c = text[left - 1]
        if c in CLOSING:
            if depth == 0 and c == "}" and text[left : left + 1] == "\n":
                break  # of a block before
            depth += 1
        elif c in OPENING:
            if depth == 0:
                break
            depth -= 1
        elif depth == 0 and ends_before(text, left):
            break
        left -= 1
    depth, right = 0, end
    while right < len(text):
        c = text[right]
        if c in OPENING:
            depth += 1
        elif c in CLOSING:
            if depth == 0:
                break
            depth -= 1
        elif depth == 0 and (c in ",;?" or is_colon(text, right)):
            break
        right += 1
    whole = text[left:right]
    return left + len(whole) - len(whole.lstrip()), right - len(whole) + len(whole.rstrip())


def ends_before(text: str, at: int) -> bool:
    """Whether an expression that reaches back to `at` begins there."""
    before = text[at - 1]
    if before in ",;?" or is_colon(text, at - 1) or is_assignment(text, at - 1):
        return True
    return re.search(r"\b(return|else|case)\s$", text[max(0, at - 8) : at]) is not None


def is_colon(text: str, at: int) -> bool:
    return text[at] == ":" and text[at - 1] != ":" and text[at + 1] != ":"


def is_assignment(text: str, at: int) -> bool:
    return text[at] == "=" and text[at + 1] != "=" and text[at - 1] not in "=!<>"


def switched(text: str, mutants: dict[int, Mutant]) -> tuple[str, dict[int, list[int]]]:
    """A file with some mutants in it, each behind its number, and which there are in each of its lines."""
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    spans: list[tuple[int, int, list[int]]] = []
    for number, mutant in mutants.items():
        at, upto = starts[mutant.line] + mutant.start, starts[mutant.line] + mutant.end
        left, right = expression_around(text, at, upto)
        inside = [number]
        for span in [span for span in spans if span[0] < right and left < span[1]]:
            spans.remove(span)
            left, right, inside = min(left, span[0]), max(right, span[1]), sorted(inside + span[2])
        spans.append((left, right, inside))
    lines: dict[int, list[int]] = {}
    for left, right, inside in sorted(spans, reverse=True):
        choice = ""
        for number in inside:
            mutant = mutants[number]
            at, upto = starts[mutant.line] + mutant.start, starts[mutant.line] + mutant.end
            other = text[left:at] + mutant.new + text[upto:right]
            one_line = " ".join(re.sub("//.*", "", line) for line in other.splitlines())
            choice += f"overlapper_mutant == {number} ? ({one_line}) : "
        for line in range(text.count("\n", 0, left), text.count("\n", 0, right) + 1):
            lines.setdefault(line, []).extend(inside)
        text = f"{text[:left]}({choice}({text[left:right]})){text[right:]}"
    return text, lines


def write(path: Path, content: bytes) -> None:
    """Leaves a file as it is that has this content, so that nothing is built again without need."""
    if not path.exists() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


class Bench:
    """A copy of the tree in which mutants are shown to tests one by one."""

    folder: Path

    def __init__(self, mutants: dict[int, Mutant]) -> None:
        self.tree, self.python = self.folder / "tree", self.folder / "venv" / "bin" / "python"
        self.mutants = mutants
        self.limits: dict[str, int] = {}  # seconds of processor time for some tests
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        names = [name for name in run(listed, ROOT).stdout.split("\0") if name and (ROOT / name).is_file()]
        # As they are now: others may change them while mutants are built and shown.
        self.files = {name: (ROOT / name).read_bytes() for name in names}
        for path in self.tree.rglob("*"):
            if path.is_file() and path.relative_to(self.tree).as_posix() not in self.files:
                path.unlink()
        self.prepare()
        if not self.python.exists():
            venv.create(self.folder / "venv", symlinks=True)
        # Folders that a .pth names are on the path, but their own .pth are not read: the tree comes before an editable
        # package.
        site = next((self.folder / "venv").glob("lib/python*/site-packages"))
        others = [path for path in sys.path if path.endswith("site-packages")]
        (site / "tree.pth").write_text("\n".join([str(self.tree), *others]) + "\n")
        self.measure_limits()

    def measure_limits(self) -> None:
        pass

    def prepare(self) -> None:
        raise NotImplementedError

    def complaint(self, number: int, tests: list[str], seconds: int) -> str:
        """The test that fails with the mutant of that number, or nothing if all pass."""
        left_out = [f"--ignore-glob=*/{name}" for name in LEFT_OUT]
        command = [str(self.python), "-m", "pytest", "-q", "-x", "--tb=no", "-p", "no:cacheprovider"]
        command += [*tests, "-k", NOT_ASKED, *left_out]
        try:
            done = run(command, self.tree, seconds, check=False, mutant=number)
        except subprocess.TimeoutExpired:
            return f"no end in {PATIENCE * seconds} s"
        if done.returncode == 0:
            return ""
        if done.returncode == -signal.SIGXCPU:
            return f"no end in {seconds} s of processor time"
        noticed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
        if noticed:
            return noticed[1]
        return f"the process ended by {done.returncode}" if done.returncode < 0 else done.stdout[-300:].strip()

    def noticed(self, number: int, quick: bool) -> str:
        stages = self.mutants[number].stages[: 1 if quick else None]
        return next(filter(None, (self.complaint_by_mutant(number, tests) for tests in stages)), "")

    def complaint_by_mutant(self, number: int, tests: list[str]) -> str:
        found = self.complaint(number, tests, self.limits.get(tests[0], MOST_SECONDS))
        if found.startswith("tests/") and (failed := self.complaint(0, [found], MOST_SECONDS)):
            raise SystemExit(f"without a mutant: {failed}")
        return found


class NativeBench(Bench):
    """All mutants in one build, each behind its number."""

    folder = WORK / "core"

    def prepare(self) -> None:
        self.build = self.folder / "build"
        self.lines = self.write_mutants()
        switch = self.folder / "switch.h"
        write(switch, SWITCH.encode())
        settings = [f"-DPython_EXECUTABLE={sys.executable}", "-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG"]
        settings += ["-DCMAKE_UNITY_BUILD=OFF"]  # a mutant then costs one source
        settings += [f"-DCMAKE_CXX_FLAGS=-w -include {switch}"]
        run(["cmake", "-S", str(self.tree / NATIVE), "-B", str(self.build), *settings], self.tree)
        while wrong := self.not_compiling():
            for number in wrong:
                del self.mutants[number]
            self.lines = self.write_mutants()
        for module in self.build.glob("_core*.so"):
            shutil.copyfile(module, self.tree / "overlapper" / module.name)

    def measure_limits(self) -> None:
        """From the processor time that the first tests take without a mutant."""
        for tests in (mutant.stages[0] for mutant in self.mutants.values()):
            if tests[0] not in self.limits:
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                if failed := self.complaint(0, tests, MOST_SECONDS):
                    raise SystemExit(f"without a mutant: {failed}")
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                self.limits[tests[0]] = int(SLOWER * (after.ru_utime - before.ru_utime)) + LEAST_SECONDS

    def write_mutants(self) -> dict[str, dict[int, list[int]]]:
        """Which mutants there are in each line of each file."""
        texts, lines = dict(self.files), {}
        for file in {mutant.file for mutant in self.mutants.values()}:
            of_file = {number: mutant for number, mutant in self.mutants.items() if mutant.file == file}
            text, lines[file] = switched(self.files[NATIVE + file].decode(), of_file)
            texts[NATIVE + file] = text.encode()
        for name, content in texts.items():
            write(self.tree / name, content)
        return lines

    def not_compiling(self) -> set[int]:
        """Mutants that do not compile, or not behind a switch."""
        command = ["cmake", "--build", str(self.build), "--target", "_core", "--parallel", f"{os.cpu_count()}"]
        done = run([*command, "--", "-k"], self.tree, check=False)
        if done.returncode == 0:
            return set()
        said, wrong = done.stdout + done.stderr, set()
        for file, line in re.findall(r"^(\S+?):(\d+):\d+: +(?:fatal )?error", said, re.MULTILINE):
            path = (self.build / file).resolve()  # ccache may say it from there
            if path.is_relative_to(self.tree / NATIVE):
                of_file = self.lines.get(path.relative_to(self.tree / NATIVE).as_posix(), {})
                wrong |= {*of_file.get(int(line) - 1, [])}
        if not wrong:
            raise SystemExit(said[-3000:])
        return wrong


class PythonBench(Bench):
    """One mutant at a time, in the file itself."""

    folder = WORK / "python"

    def prepare(self) -> None:
        for name, content in self.files.items():
            write(self.tree / name, content)
        for number, text in {number: self.text_with(number) for number in self.mutants}.items():
            try:
                compile(text, self.mutants[number].file, "exec")
            except SyntaxError:
                del self.mutants[number]
        core = Path(_core.__file__)
        for built in core.parent.glob("_core*"):
            shutil.copyfile(built, self.tree / "overlapper" / built.name)

    def complaint(self, number: int, tests: list[str], seconds: int) -> str:
        if not number:
            return super().complaint(number, tests, seconds)
        file = f"overlapper/{self.mutants[number].file}"
        write(self.tree / file, self.text_with(number))
        try:
            return super().complaint(number, tests, seconds)
        finally:
            write(self.tree / file, self.files[file])

    def text_with(self, number: int) -> bytes:
        mutant = self.mutants[number]
        lines = self.files[f"overlapper/{mutant.file}"].decode().split("\n")
        return "\n".join([*lines[: mutant.line], mutant.after, *lines[mutant.line + 1 :]]).encode()


def run(command, folder, seconds=0, check=True, mutant=None):
    """With a mutant, for so many seconds of processor time, as others may use the machine."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))

    # Compiled Python is told from a mutant's by its second of time and its size, which a mutant may share.
    alone = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        command, cwd=folder, env={**os.environ, **alone, "OVERLAPPER_MUTANT": f"{mutant or 0}"}, capture_output=True,
        text=True, errors="replace", check=check, timeout=PATIENCE * seconds or None,
        preexec_fn=None if mutant is None else limit,
    )  # fmt: skip


COLUMNS = ["file", "before", "after", "noticed_by"]


def read_results(path: Path) -> dict[tuple[str, str, str], str]:
    if not path.exists():
        return {}
    with path.open(newline="") as lines:
        return {(row["file"], row["before"], row["after"]): row["noticed_by"] for row in csv.DictReader(lines)}


def keep_results(path: Path, results: dict[tuple[str, str, str], str]) -> None:
    with path.open("w", newline="") as out:
        csv.writer(out, lineterminator="\n").writerows([COLUMNS, *([*name, by] for name, by in results.items())])


@dataclass(frozen=True)
class Draw:
    asked: list[Mutant]
    elsewhere: int  # mutants of other folders
    known: int  # as equivalent
    not_drawn: int


def draw(everything: list[Mutant], seed: int, count: int, under: str) -> Draw:
    equivalent = known_equivalent()
    shuffled = random.Random(seed).sample(everything, len(everything))
    inside = [mutant for mutant in shuffled if mutant.file.startswith(under)]
    unknown = [mutant for mutant in inside if mutant.name not in equivalent]
    return Draw(unknown[:count], len(shuffled) - len(inside), len(inside) - len(unknown), max(0, len(unknown) - count))


def report(drawn: Draw, made: list[Mutant], earlier: int, results: dict[tuple[str, str, str], str]) -> list[str]:
    """The survivors, how many were noticed, and all that was left out."""
    shown = [mutant for mutant in made if mutant.name in results]
    survived = [mutant for mutant in shown if not results[mutant.name]]
    return [
        *map(survivor, survived),
        f"{len(shown) - len(survived)} of {len(shown)} mutants are noticed.",
        "Left out:",
        f"- {drawn.known} mutants known as equivalent, {len(drawn.asked) - len(made)} that do not compile",
        f"- {drawn.not_drawn} mutants not drawn, {drawn.elsewhere} elsewhere, and all of {NATIVE}{{python,fuzz}}",
        f"- {len(made) - len(shown)} mutants not shown before the end, {earlier} shown by earlier runs only",
        f"- tests in {', '.join(LEFT_OUT)}, and those of other names than -k '{NOT_ASKED}'",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=200, help="mutants drawn that are not known as equivalent")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants of the core shown at once")
    parser.add_argument("--python", action="store_true", help="mutants of Python in the place of the core's")
    parser.add_argument("--under", default="", help="the folder or file that mutants are drawn from, as in forces/")
    parser.add_argument("--quick", action="store_true", help="show them to the first tests only; then use --again")
    parser.add_argument("--again", action="store_true", help="show those once more that survived")
    chosen = parser.parse_args()

    core, package = all_mutants(), all_mutants(python=True)
    if gone := known_equivalent().keys() - {mutant.name for mutant in core + package}:
        raise SystemExit(f"{EQUIVALENT.name} names what is not in the source: {sorted(gone)}")
    drawn = draw(package if chosen.python else core, chosen.seed, chosen.count, chosen.under)
    bench = (PythonBench if chosen.python else NativeBench)(dict(enumerate(drawn.asked, 1)))
    made = bench.mutants
    print(f"{len(made)} of {len(drawn.asked)} mutants compile", flush=True)

    file = WORK / f"{'python-' * chosen.python}seed-{chosen.seed}.csv"
    results = {name: by for name, by in read_results(file).items() if by or not chosen.again}
    left = [number for number in made if made[number].name not in results]

    def show(number: int) -> None:
        results[made[number].name] = by = bench.noticed(number, chosen.quick)
        keep_results(file, results)
        shown = sum(mutant.name in results for mutant in made.values())
        print(f"{shown}/{len(made)} {by or survivor(made[number])}", flush=True)

    jobs = ThreadPoolExecutor(1 if chosen.python else chosen.jobs)
    try:
        for shown in [jobs.submit(show, number) for number in left]:
            shown.result()
    finally:
        jobs.shutdown(cancel_futures=True)
        print(*report(drawn, [*made.values()], len(made) - len(left), results), sep="\n")
        if chosen.quick:
            print("- by --quick, all tests but the first that a mutant is shown to")


def survivor(mutant: Mutant) -> str:
    return f"survived: {mutant.file}:{mutant.line + 1}\n  - {mutant.before.strip()}\n  + {mutant.after.strip()}"


if __name__ == "__main__":
    main()
