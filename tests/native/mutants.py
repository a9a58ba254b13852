"""Which small faults of the core its tests notice: `make mutants`.

A mutant is the core with one operator or constant changed: + for -, < for <=, && for ||, min for max, no ! and so on.
A seed draws some of them. They are built all at once in a copy of the tree under build/mutants, each behind its number,
and shown to the tests of the core one by one. The recorded answers come first, as they notice most mutants within a
second or two; the tests of the mutant's folder follow, and then all tests of the core. Mutants of forces/ are shown to
the tests of forces alone, as no other native test reaches them. A mutant that no test notices is either equivalent, and
then named in EQUIVALENT with the reason, or a test is missing. Results are kept in build/mutants and not asked for
again; `--again` shows the survivors once more.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import venv
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build" / "mutants"
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.csv")
NOT_THE_CORE = ("python", "fuzz")
PATIENCE = 10  # times the processor time that tests may take: a mutant may wait for ever
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

# Tests of the core that such faults cannot change: those of the stub, memory and signals.
LEFT_OUT = ("test_stub.py", "test_out_of_memory.py", "test_mutants.py")
NOT_ASKED = "not memory and not ctrl_c and not spawn and not process"
QUICK = "tests/native/test_recorded_answers.py"
OF_FORCES = ["tests/native/forces", "tests/native/python/test_contact_solver.py"]


@dataclass(frozen=True)
class Mutant:
    file: str  # below the native folder
    line: int  # from 0
    before: str  # the line
    start: int  # of what is changed in it
    end: int
    new: str

    @property
    def after(self) -> str:
        return self.before[: self.start] + self.new + self.before[self.end :]

    @property
    def tests(self) -> list[list[str]]:
        """The tests that may notice it, in stages: tests mirror the folders of the core."""
        folder = self.file.split("/")[0]
        if folder == "forces":
            return [OF_FORCES]
        own = f"tests/native/{folder}"
        stages = [[QUICK], [own], ["tests/native", f"--ignore={QUICK}", f"--ignore={own}"]]
        return [stage for stage in stages if (ROOT / stage[0]).exists()]

    @property
    def name(self) -> tuple[str, str, str]:
        """The mutant without its line number and the line's comment, which change with the file."""
        return self.file, code_of(self.before), code_of(self.after)


def code_of(line: str) -> str:
    return line.partition(" //")[0].strip()


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


def all_mutants(native: Path) -> list[Mutant]:
    files = sorted(path for path in native.rglob("*") if path.suffix in (".cpp", ".h"))
    names = [path.relative_to(native).as_posix() for path in files]
    return [
        mutant
        for name, path in zip(names, files)
        if not name.startswith(NOT_THE_CORE)
        for mutant in mutants_of(name, path.read_text())
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


class Bench:
    """A copy of the tree, built once with some mutants in it, which are then shown to the tests one by one."""

    def __init__(self, folder: Path, mutants: dict[int, Mutant]) -> None:
        self.tree, self.build, self.python = folder / "tree", folder / "build", folder / "venv" / "bin" / "python"
        self.mutants = mutants
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        names = [name for name in run(listed, ROOT).stdout.split("\0") if name and (ROOT / name).is_file()]
        shutil.rmtree(self.tree, ignore_errors=True)
        for name in names:
            (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, self.tree / name)
        # As they are now: others may change them while they are built and shown.
        self.texts = {mutant.file: (self.native / mutant.file).read_text() for mutant in mutants.values()}
        if not self.python.exists():
            venv.create(folder / "venv", symlinks=True)
        # Folders that a .pth names are on the path, but their own .pth are not read: the tree comes before an editable
        # package.
        site = next((folder / "venv").glob("lib/python*/site-packages"))
        others = [path for path in sys.path if path.endswith("site-packages")]
        (site / "tree.pth").write_text("\n".join([str(self.tree), *others]) + "\n")
        switch = folder / "switch.h"
        switch.write_text(SWITCH)
        # Hardly optimised: sooner built, and the same bits.
        settings = [f"-DPython_EXECUTABLE={sys.executable}", "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG"]
        settings += [f"-DCMAKE_CXX_FLAGS=-w -include {switch}"]
        run(["cmake", "-S", str(self.native), "-B", str(self.build), *settings], self.tree)
        self.compile()

    @property
    def native(self) -> Path:
        return self.tree / "overlapper" / "native"

    def compile(self) -> None:
        """Leaves out mutants that do not compile, or not behind a switch."""
        while True:
            lines = {}
            for file in sorted({mutant.file for mutant in self.mutants.values()}):
                of_file = {number: mutant for number, mutant in self.mutants.items() if mutant.file == file}
                text, lines[file] = switched(self.texts[file], of_file)
                if text != (self.native / file).read_text():
                    (self.native / file).write_text(text)
            command = ["cmake", "--build", str(self.build), "--target", "_core", "--parallel", f"{os.cpu_count()}"]
            done = run([*command, "--", "-k"], self.tree, check=False)
            if done.returncode == 0:
                break
            wrong = set()
            for file, line in re.findall(
                r"^(\S+?):(\d+):\d+: +(?:fatal )?error", done.stdout + done.stderr, re.MULTILINE
            ):
                name = Path(file).resolve().relative_to(self.native.resolve()).as_posix() if "native" in file else ""
                wrong |= {*lines.get(name, {}).get(int(line) - 1, [])}
            if not wrong:
                raise SystemExit((done.stdout + done.stderr)[-3000:])
            print(f"{len(wrong)} mutants do not compile", flush=True)
            for number in wrong:
                file, line = self.mutants[number].file, self.mutants[number].line
                del self.mutants[number]
                if not any(mutant.file == file for mutant in self.mutants.values()):
                    (self.native / file).write_text(self.texts[file])
        for module in self.build.glob("_core*.so"):
            shutil.copyfile(module, self.tree / "overlapper" / module.name)
        for tests in ([QUICK], OF_FORCES):
            if failed := self.complaint(0, tests, seconds=600):
                raise SystemExit(f"without a mutant: {failed}")

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
        noticed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
        if noticed:
            return noticed[1]
        return f"the process ended by {done.returncode}" if done.returncode < 0 else done.stdout[-300:].strip()

    def noticed(self, number: int, quick: bool) -> str:
        first, *others = self.mutants[number].tests
        if quick:
            others = []
        return self.complaint(number, first, seconds=90) or next(
            filter(None, (self.complaint(number, tests, seconds=900) for tests in others)), ""
        )


def run(command, folder, seconds=0, check=True, mutant=None):
    """With a mutant, for so many seconds of processor time, as others may use the machine."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))

    alone = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OVERLAPPER_MUTANT": f"{mutant or 0}"}
    return subprocess.run(
        command, cwd=folder, env={**os.environ, **alone}, capture_output=True, text=True, errors="replace", check=check,
        timeout=PATIENCE * seconds or None, preexec_fn=None if mutant is None else limit,
    )  # fmt: skip


COLUMNS = ["file", "line", "before", "after", "noticed_by"]


def read_results(path: Path) -> dict[tuple[str, str, str], str]:
    if not path.exists():
        return {}
    with path.open(newline="") as lines:
        return {(row["file"], row["before"], row["after"]): row["noticed_by"] for row in csv.DictReader(lines)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=200, help="mutants drawn that are not known as equivalent")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants shown to the tests at once")
    parser.add_argument("--under", default="", help="the folder or file that mutants are drawn from, as in forces/")
    parser.add_argument("--quick", action="store_true", help="show them to the first tests only; then use --again")
    parser.add_argument("--again", action="store_true", help="show those once more that survived")
    chosen = parser.parse_args()

    everything = all_mutants(ROOT / "overlapper" / "native")
    equivalent = known_equivalent()
    if gone := equivalent.keys() - {mutant.name for mutant in everything}:
        raise SystemExit(f"{EQUIVALENT.name} names what is not in the source: {sorted(gone)}")
    drawn = random.Random(chosen.seed).sample(everything, len(everything))
    asked = [mutant for mutant in drawn if mutant.name not in equivalent and mutant.file.startswith(chosen.under)]
    bench = Bench(WORK, dict(enumerate(asked[: chosen.count], 1)))
    print(f"{len(bench.mutants)} of {chosen.count} mutants compile", flush=True)

    file = WORK / f"seed-{chosen.seed}.csv"
    known = {name: by for name, by in read_results(file).items() if by or not chosen.again}
    results: dict[int, str] = {
        number: known[mutant.name] for number, mutant in bench.mutants.items() if mutant.name in known
    }

    def write() -> None:
        with file.open("w", newline="") as out:
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(COLUMNS)
            for number, by in sorted(results.items()):
                mutant = bench.mutants[number]
                writer.writerow([mutant.name[0], mutant.line + 1, *mutant.name[1:], by])

    def show(number: int) -> None:
        results[number] = bench.noticed(number, chosen.quick)
        print(f"{len(results)}/{len(bench.mutants)} {results[number] or survivor(bench.mutants[number])}", flush=True)
        write()

    with ThreadPoolExecutor(chosen.jobs) as jobs:
        for shown in [jobs.submit(show, number) for number in bench.mutants if number not in results]:
            shown.result()
    write()
    survived = [bench.mutants[number] for number, by in sorted(results.items()) if not by]
    print(*map(survivor, survived), sep="\n")
    print(f"{len(results) - len(survived)} of {len(results)} mutants of seed {chosen.seed} are noticed")


def survivor(mutant: Mutant) -> str:
    return f"survived: {mutant.file}:{mutant.line + 1}\n  - {mutant.before.strip()}\n  + {mutant.after.strip()}"


if __name__ == "__main__":
    main()
