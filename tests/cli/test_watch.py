"""A pybullet script is watched unchanged: its output and its exit code are its own, and its overlaps are reported."""

import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from cubes import SCENE

from overlapper.tables.table_file import read_metadata, read_table

# The same scene, stepped by its own main.
HEAD = (
    SCENE
    + """
import sys

def steps(count, client=None):
    client = p.connect(p.DIRECT) if client is None else client
    build(client)
    for _ in range(count):
        p.stepSimulation(client)
    return client
"""
)

WAYS_TO_STEP = {
    "keyword": "c = p.connect(p.DIRECT); build(c)\nfor _ in range(20): p.stepSimulation(physicsClientId=c)",
    "position": "steps(20)",
    "default": "c = p.connect(p.DIRECT); build(c)\nfor _ in range(20): p.stepSimulation()",
    "star": "from pybullet import *\nc = connect(DIRECT); build(c)\nfor _ in range(20): stepSimulation()",
    "client": (
        "from pybullet_utils.bullet_client import BulletClient\n"
        "c = BulletClient(p.DIRECT); build(c._client)\nfor _ in range(20): c.stepSimulation()"
    ),
    "second": "p.connect(p.DIRECT); c = p.connect(p.DIRECT); build(c)\nfor _ in range(20): p.stepSimulation(c)",
    "thread": "import threading\nthreading.Thread(target=steps, args=(20,)).start()",
    "renewed": "c = p.connect(p.DIRECT); build(c); p.resetSimulation(physicsClientId=c); steps(20, c)",
}

COMMAND = [sys.executable, "-m", "overlapper"]


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)


def script(text, head=HEAD):
    Path("script.py").write_text(head + textwrap.dedent(text))


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def watch(*arguments):
    return run(*COMMAND, "watch", *arguments)


def alone(*arguments):
    return run(sys.executable, "script.py", *arguments)


def said(done):
    """The lines of stderr but for the one that pybullet prints on import."""
    return re.sub(r"^pybullet build time.*\n", "", done.stderr, flags=re.MULTILINE)


@pytest.fixture(scope="module")
def run_of_scene(tmp_path_factory):
    """The rows and the printed table of `overlapper run`."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "scene.py").write_text(SCENE)
    done = run(*COMMAND, "run", folder / "scene.py", "--out", folder / "run.csv")
    assert done.returncode == 0
    return read_table(folder / "run.csv"), done.stdout.partition("at\npair")[2].partition("bodies,")[0]


@pytest.mark.parametrize("way", WAYS_TO_STEP)
def test_watch_writes_the_table_of_a_run_however_the_script_steps(way, run_of_scene):
    script(WAYS_TO_STEP[way])
    rows, table = run_of_scene
    watched = watch("--out", "watched.csv", "script.py")
    assert (watched.returncode, watched.stdout) == (0, alone().stdout)
    assert "Overlaps of script.py in 20 steps, 0.0833 s" in watched.stderr
    assert "Written: watched.csv" in watched.stderr
    assert len(rows) >= 20
    assert read_table(Path("watched.csv")) == rows
    assert sorted(path.name for path in Path().iterdir()) == ["script.py", "watched.csv"]
    # But for the name, and Bullet's own numbers.
    assert watched.stderr.partition("at\npair")[2].partition("bodies,")[0] == table
    heading = read_metadata(Path("watched.csv"))
    assert heading.items() >= {"simulation": "script.py", "every": "1", "pairs": "simulated", "per": "shape"}.items()


@pytest.mark.parametrize("ending", ["csv", "parquet", "sqlite"])
def test_options_are_those_of_a_run(ending):
    script("steps(20)\np.setCollisionFilterPair(0, 1, -1, -1, 0)\n" + "for _ in range(5): p.stepSimulation()")
    options = ["--out", f"made/own.{ending}", "--html", "made/own.html", "--check", "fcl", "--per", "shape"]
    done = watch("--pairs", "all", "--surface", "margin", "--json", *options, "script.py")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stderr.splitlines()[-1])
    (simulation,) = answer["simulations"]
    assert answer["finished"] and answer["settings"]["pairs"] == "all" and answer["settings"]["check"] == "fcl"
    assert simulation["steps"] == simulation["measured"] == 25
    assert simulation["written"] == [f"made/own.{ending}", "made/own.html"]
    rows = read_table(Path(f"made/own.{ending}"))
    assert {row["step"] for row in rows} == set(range(1, 26)) and {row["fcl"] for row in rows} == {"agree"}
    assert simulation["fcl"] == {"agree": len(rows)}
    assert Path("made/own.html").stat().st_size > 100_000


def test_pair_filters_that_the_script_sets_are_known():
    script("c = p.connect(p.DIRECT); build(c); p.setCollisionFilterPair(0, 1, -1, -1, 0); p.stepSimulation()")
    said = [watch("--json", f"--pairs={pairs}", "script.py").stderr for pairs in ("simulated", "all")]
    answers = [json.loads(words.splitlines()[-1]) for words in said]
    fewer, more = ({tuple(pair["names"]) for pair in answer["simulations"][0]["pairs"]} for answer in answers)
    assert more - fewer == {("box#0", "box#1")}


def test_every_so_many_steps_are_measured():
    script("steps(20)")
    assert watch("--out", "all.csv", "script.py").returncode == 0
    done = watch("--out", "some.csv", "--every", "6", "script.py")
    assert "One step in 6 was measured, 3 of 20." in done.stderr
    chosen = [row for row in read_table(Path("all.csv")) if row["step"] in (6, 12, 18)]
    assert chosen and read_table(Path("some.csv")) == chosen
    done = watch("--out", "none.csv", "--every", "21", "script.py")
    assert said(done) == "overlapper: nothing was measured: script.py made 20 steps, fewer than --every\n"
    assert done.returncode == 2 and not Path("none.csv").exists()


def test_times_follow_the_time_step():
    script("c = steps(2); p.setTimeStep(0.5); p.stepSimulation(); p.stepSimulation()")
    watch("--out", "own.csv", "script.py")
    times = dict.fromkeys((row["step"], row["time_s"]) for row in read_table(Path("own.csv")))
    assert [*times] == [(1, 1 / 240), (2, 2 / 240), (3, 2 / 240 + 0.5), (4, 2 / 240 + 1.0)]


def test_watch_keeps_the_output_arguments_and_globals_of_a_script(tmp_path):
    (tmp_path / "beside.py").write_text("WORD = 'found'")
    script(
        """
        import beside, os, pickle
        class Thing: pass
        print(sys.argv, __name__, __file__, sys.path[0], __spec__, __doc__, sorted(globals())[:6], flush=True)
        print(beside.WORD, pickle.dumps(Thing()), sys.modules["__main__"].Thing is Thing, flush=True)
        os.write(1, b"of C")
        print("on stderr", file=sys.stderr)
        steps(20)
        print(p.getBasePositionAndOrientation(2), p.getContactPoints())
        """
    )
    arguments = ["--out", "x.csv", "--", "a b", "--every=3"]
    watched, plain = watch("script.py", *arguments), alone(*arguments)
    assert watched.stdout == plain.stdout and "'--out', 'x.csv', '--', 'a b', '--every=3'] __main__" in plain.stdout
    assert said(watched).startswith(said(plain)) and said(plain) == "on stderr\n"
    assert watched.returncode == plain.returncode == 0


ENDS = {
    "no code": "sys.exit()",
    "a code": "sys.exit(7)",
    "a word": "sys.exit('so be it')",
    "an exception": "1 / 0",
    "one with a cause": "try: 1 / 0\nexcept ZeroDivisionError as error: raise ValueError('two') from error",
    "one of pybullet": "p.disconnect(); p.stepSimulation()",
    "memory": "raise MemoryError",
    "a hook of its own": "sys.excepthook = lambda *error: print('hooked', error[1]); 1 / 0",
    "an exit of C": "import os; os._exit(5)",
    "a signal": "import os; os.kill(os.getpid(), 15)",
    "an interruption": "raise KeyboardInterrupt",
    "at exit": "import atexit; atexit.register(print, 'at exit')",
}


@pytest.mark.parametrize("end", ENDS)
def test_watch_keeps_the_exit_code_of_a_script(end):
    script(f"steps(3)\n{ENDS[end]}")
    watched, plain = watch("--out", "own.csv", "script.py"), alone()
    assert watched.returncode == plain.returncode
    assert watched.stdout == plain.stdout
    words = said(plain) if end != "a word" else ""  # which Python says last of all
    assert said(watched).startswith(words)
    if end == "a word":
        assert watched.stderr.endswith("so be it\n") and plain.stderr.endswith("so be it\n")
    failed = end in ("an exception", "one with a cause", "memory", "a hook of its own", "an exit of C", "a signal")
    kept = Path("own.unfinished.csv" if failed else "own.csv")
    assert {row["step"] for row in read_table(kept)} == {1, 2, 3}
    if end not in ("an exit of C", "a signal"):
        assert f"Written: {kept}\n" in watched.stderr


def test_watch_shows_the_syntax_error_of_a_script_as_python_does():
    script("def half(", head="")
    watched, plain = watch("script.py"), alone()
    assert watched.returncode == plain.returncode == 1
    assert said(watched).startswith(plain.stderr) and "SyntaxError" in plain.stderr and "Traceback" not in plain.stderr


@pytest.mark.parametrize("catches", [False, True])
def test_ctrl_c_goes_to_the_script(catches):
    loop = "while True: p.stepSimulation()"
    caught = f"try:\n    {loop}\nexcept KeyboardInterrupt:\n    print('caught'); p.stepSimulation(); sys.exit(4)"
    script(f"c = p.connect(p.DIRECT); build(c); print('here', flush=True)\n{caught if catches else loop}")
    command = [*COMMAND, "watch", "--out", "own.csv", "--check", "fcl", "script.py"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, start_new_session=True, **pipes) as process:
        assert process.stdout.readline() == "here\n"
        while not (part := Path("own.unfinished.csv")).exists() or len(part.read_text().splitlines()) < 40:
            assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does, to all that it has started
        output, complaints = process.communicate(timeout=30)
    assert process.returncode == (4 if catches else -signal.SIGINT)
    assert output == ("caught\n" if catches else "")
    rows = read_table(Path("own.csv"))
    steps = sorted({row["step"] for row in rows})
    assert steps[0] == 1 and len(steps) >= steps[-1] - 1  # one may have been interrupted before anything was written
    assert {row["fcl"] for row in rows} == {"agree"}
    assert ("KeyboardInterrupt" in complaints) is not catches and "overlapper/" not in complaints
    assert (
        bool(re.search(r"^Interrupted after step \d+; the steps before are kept\.$", complaints, re.M)) is not catches
    )


def test_two_clients_have_a_table_each():
    script(
        """
        a, b = p.connect(p.DIRECT), p.connect(p.DIRECT)
        build(a), build(b)
        for _ in range(3): p.stepSimulation(b)
        for _ in range(5): p.stepSimulation(a)
        p.disconnect(b)
        assert p.connect(p.DIRECT) == b
        steps(2, b)
        """
    )
    done = watch("--out", "own.csv", "--html", "own.html", "script.py")
    assert done.returncode == 0
    tables = [Path(name) for name in ("own.csv", "own-2.csv", "own-3.csv")]
    assert [{row["step"] for row in read_table(path)} for path in tables] == [{1, 2, 3}, {1, 2, 3, 4, 5}, {1, 2}]
    heads = re.findall(r"Overlaps of (.*) in", done.stderr)
    assert heads == ["script.py", "script.py, simulation 2", "script.py, simulation 3"]
    assert all(Path(name).exists() for name in ("own.html", "own-2.html", "own-3.html"))


def test_steps_of_a_forked_process_are_not_watched():
    script("import os\nc = steps(3)\nif os.fork() == 0:\n    steps(4)\nelse:\n    os.wait()\n    p.stepSimulation(c)")
    done = watch("--out", "own.csv", "script.py")
    assert done.returncode == 2 and done.stderr.count("Written: own.csv") == 1
    assert done.stderr.endswith("script.py stepped simulations in other processes, which are not watched\n")
    assert {row["step"] for row in read_table(Path("own.csv"))} == {1, 2, 3, 4}
    script("import os\nif os.fork() == 0:\n    steps(4)\nelse:\n    os.wait()")
    done = watch("--json", "script.py")
    answer = json.loads(done.stderr.splitlines()[-1])
    assert (
        done.returncode == 2
        and answer["simulations"] == []
        and answer["not_watched"]
        == [
            "nothing was measured: script.py made no step in its own process",
            "script.py stepped simulations in other processes, which are not watched",
        ]
    )


CHILD = """
import sys, time
if "other" not in sys.argv:
    import pybullet as p
    p.connect(p.DIRECT)
    p.stepSimulation()
time.sleep(0.5)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells what other processes have loaded")
def test_processes_that_load_pybullet_are_told():
    Path("child.py").write_text(CHILD)
    script("import subprocess\nsteps(3)\nsubprocess.run([sys.executable, 'child.py', *sys.argv[1:]], check=True)")
    done = watch("script.py")
    words = "script.py started another process that loads pybullet: steps in other processes are not watched"
    assert (done.returncode, done.stderr.splitlines()[-1]) == (2, f"overlapper: {words}")
    assert "Overlaps of script.py in 3 steps" in done.stderr
    done = watch("script.py", "other")
    assert done.returncode == 0 and "process" not in done.stderr
    script(
        """
        import multiprocessing, time
        def work():
            steps(4)
            time.sleep(0.5)
        if __name__ == "__main__":
            child = multiprocessing.get_context("spawn").Process(target=work)
            child.start()
            child.join()
        """
    )
    done = watch("--json", "script.py")
    assert done.returncode == 2 and json.loads(done.stderr.splitlines()[-1])["not_watched"] == [
        "nothing was measured: script.py made no step in its own process",
        words,
    ]


def test_shapes_and_bodies_that_are_left_out_end_a_watch_with_2():
    script("c = steps(2)\np.resetBasePositionAndOrientation(1, [float('nan')] * 3, [0, 0, 0, 1])\np.stepSimulation()")
    done = watch("script.py")
    assert done.returncode == 2 and "\nNot modelled from step 3 on: box#1, it has no finite pose" in done.stderr


def test_bodies_are_named_by_the_command_and_options_of_ours_behind_the_script_are_told():
    script("steps(3); p.removeBody(1); p.stepSimulation(); print(sys.argv)")
    done = watch(
        "--name", "0=table", "--name", "1=cup", "--name=9=duck", "--every", "1", "script.py", "--out=a.csv", "--every=3"
    )
    assert (done.returncode, done.stdout) == (0, "['script.py', '--out=a.csv', '--every=3']\n")
    assert re.search(r"^table +3 .*\n cup +$", done.stderr, re.MULTILINE)
    assert done.stderr.splitlines()[-2:] == [
        "overlapper: --name 9=duck: no measured step had a body 9",
        "overlapper: --out stands after script.py and was an argument of the script: "
        "options of overlapper watch stand before the script",
    ]
    for words, sentence in (
        (["--name", "cup=1"], "--name must be BODY=NAME, such as 3=duck, not 'cup=1'"),
        (["--name", "1=cup", "--name", "1=duck"], "--name gives 1 twice"),
    ):
        done = watch(*words, "script.py")
        assert (done.returncode, done.stdout, done.stderr) == (2, "", f"overlapper: {sentence}\n")


INTERRUPTED = """
import os, signal
signal.signal(signal.SIGINT, signal.default_int_handler)
class Press:
    def find_spec(self, name, path=None, target=None):
        if name == "overlapper.cli.summary":
            os.kill(os.getpid(), signal.SIGINT)
steps(3)
sys.meta_path.insert(0, Press())
"""


def test_ctrl_c_after_the_end_of_the_script_is_one_sentence():
    script(INTERRUPTED)
    done = watch("--out", "own.csv", "script.py")
    assert done.returncode == 130 and "Traceback" not in done.stderr
    assert done.stderr.endswith("overlapper: interrupted; the files are written\n")
    assert {row["step"] for row in read_table(Path("own.csv"))} == {1, 2, 3}


def test_a_script_that_never_steps_gets_a_message():
    script("print('nothing'); sys.exit(3)")
    done = watch("--out", "own.csv", "script.py")
    assert (done.returncode, done.stdout) == (3, "nothing\n")
    never = "script.py never called pybullet.stepSimulation or mujoco.mj_step in its own process"
    assert said(done) == f"overlapper: nothing was measured: {never}\n"
    assert not Path("own.csv").exists()
    script("p.connect(p.DIRECT); p.setRealTimeSimulation(1)")
    assert said(watch("script.py")) == (
        "overlapper: nothing was measured: script.py never called pybullet.stepSimulation or mujoco.mj_step in its own "
        "process, and pybullet.DIRECT has no simulation in real time\n"
    )


REAL_TIME = """
import time
c = p.connect(p.SHARED_MEMORY_SERVER)  # it runs in real time without a window
build(c)
ball = p.createCollisionShape(p.GEOM_SPHERE, radius=1, physicsClientId=c)
for _ in range(2): p.createMultiBody(0, ball, basePosition=[9, 0, 0], physicsClientId=c)  # they overlap in every step
p.setRealTimeSimulation(1, physicsClientId=c)
time.sleep(0.5)
p.setRealTimeSimulation(0, c)
still = [p.getBasePositionAndOrientation(body, c) for body in range(p.getNumBodies(c))]
time.sleep(0.2)
assert still == [p.getBasePositionAndOrientation(body, c) for body in range(p.getNumBodies(c))]
"""


def test_a_simulation_in_real_time_is_sampled():
    script(REAL_TIME + "for _ in range(3): p.stepSimulation(c)")
    begin = time.monotonic()
    done = watch("--rate", "100", "--pairs", "all", "--json", "--out", "own.csv", "script.py")
    elapsed = time.monotonic() - begin
    assert done.returncode == 0, done.stderr
    (simulation,) = json.loads(said(done).splitlines()[-1])["simulations"]
    assert 1 <= simulation["sampled"] <= 100 * elapsed
    assert simulation["measured"] == simulation["steps"] == simulation["sampled"] + 3
    time_of = {row["step"]: row["time_s"] for row in read_table(Path("own.csv"))}
    times = list(time_of.values())
    assert times == sorted(times)
    assert times[-1] - times[-2] == pytest.approx(1 / 240)
    assert times[-1] < elapsed
    script(REAL_TIME + "p.disconnect(c); time.sleep(0.1)")
    assert "samples of a simulation in real time, which was held meanwhile: at most 60 a second.\n" in said(
        watch("script.py")
    )


def test_calls_between_samples_in_real_time():
    """Steps and samples count the time together. No body goes while it is sampled."""
    calls = """
p.setRealTimeSimulation(1, physicsClientId=c)
for _ in range(30):
    body = p.createMultiBody(1, ball, basePosition=[20, 0, 9], physicsClientId=c)
    p.stepSimulation(c)
    time.sleep(0.005)
    p.removeBody(body, c)
p.disconnect(c)
"""
    script(REAL_TIME + calls)
    done = watch("--rate", "200", "--pairs", "all", "--json", "--out", "own.csv", "script.py")
    assert done.returncode == 0, done.stderr
    (simulation,) = json.loads(said(done).splitlines()[-1])["simulations"]
    assert simulation["steps"] == simulation["sampled"] + 30
    times = [row["time_s"] for row in read_table(Path("own.csv"))]
    assert times == sorted(times)


def test_a_failed_sample_of_a_simulation_in_real_time_is_reported():
    script("import tempfile; tempfile.tempdir = '/no/such/folder'" + REAL_TIME)
    done = watch("--rate", "100", "script.py")
    assert done.returncode == 2
    assert "overlapper: script.py was watched up to step 1: " in said(done)
    assert run(*COMMAND, "watch", "--rate", "0", "script.py").returncode == 2


def test_a_script_without_overlaps_gets_a_message():
    script("c = p.connect(p.DIRECT); p.stepSimulation(c)")
    done = watch("script.py")
    assert said(done).startswith("Nothing overlaps in 1 steps of script.py.\n0 bodies, 0 of 0 shapes read\n")


def test_a_window_is_opened_only_on_request_and_a_missing_screen_is_reported():
    script("steps(3, p.connect(p.GUI, options='--mp4=x')); print(p.getConnectionInfo())")
    watched, plain = watch("script.py"), alone()
    assert watched.returncode == plain.returncode == 1
    words = (
        "overlapper: script.py opens a window of pybullet, but there is no screen, so pybullet ends the script: "
        "--direct runs it without a window\n"
    )
    assert words in watched.stderr
    direct = watch("--direct", "script.py")
    assert direct.returncode == 0 and "'connectionMethod': 2" in direct.stdout
    assert "Overlaps of script.py in 3 steps" in direct.stderr and words not in direct.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["none.py"], "there is no script none.py"),
        (["--every", "0", "script.py"], "'--every'"),
        (["--out", "own.txt", "script.py"], "--out must end in .csv, .parquet, .sqlite, not 'own.txt'"),
        (["--out", "script.py/own.csv", "script.py"], "cannot write script.py"),
        (["--html", ".", "script.py"], "cannot write ."),
        (["--tolerance", "2", "script.py"], "--tolerance must lie between 0 and 1, not 2.0"),
        (["--concave-threshold", "2", "script.py"], "--concave-threshold must lie between 0.01 and 1, not 2.0"),
        ([], "SCRIPT.py"),
    ],
)
def test_a_bad_option_is_refused_in_one_sentence_before_the_script_starts(arguments, words):
    script("print('started')")
    done = watch(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    sentence = done.stderr.splitlines()[-1]
    assert sentence.startswith("overlapper: ") and words in sentence


def test_a_script_that_may_not_be_read_is_named(monkeypatch):
    Path("script.py").write_text("")
    program = (
        "import sys, pathlib; from overlapper.cli import main; sys.argv = ['overlapper', 'watch', 'script.py']\n"
        "def refuse(self): raise PermissionError(13, 'Permission denied', str(self))\n"
        "import overlapper.scenes.watching; pathlib.Path.read_bytes = refuse; main()"
    )
    done = run(sys.executable, "-c", program)
    assert (done.returncode, said(done)) == (2, "overlapper: script.py: Permission denied\n")


@pytest.mark.parametrize(
    ("hidden", "arguments", "packages"),
    [
        (("pybullet", "mujoco"), [], "pybullet, or conda install -c conda-forge pybullet"),
        (("fcl",), ["--check", "fcl"], "python-fcl"),
        (("meshcat",), ["--html", "own.html"], "meshcat"),
        (("pyarrow",), ["--out", "own.parquet"], "pyarrow"),
    ],
)
def test_a_missing_library_is_named_before_the_script_starts(hidden, arguments, packages):
    Path("script.py").write_text("print('started')")
    program = (
        "import sys, importlib.util\n"
        "found = importlib.util.find_spec\n"
        f"importlib.util.find_spec = lambda name: None if name in {hidden!r} else found(name)\n"
        f"sys.modules |= dict.fromkeys({hidden!r})\n"
        f"sys.argv = ['overlapper', 'watch', *{arguments!r}, 'script.py']\nfrom overlapper.cli import main; main()"
    )
    done = run(sys.executable, "-c", program)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines()[-1].endswith(f"pip install {packages}")


FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (3500, 3500))"


@pytest.mark.parametrize(("end", "code"), [("", 2), ("sys.exit(6)", 6)])
def test_a_disk_that_is_full_ends_the_watch_and_not_the_script(end, code):
    script(f"c = steps(1)\n{FULL}\nfor _ in range(99): p.stepSimulation(c)\n{end}")
    Path("own.csv").write_text("of yesterday")
    done = watch("--out", "own.csv", "script.py")
    assert done.returncode == code
    words = r"overlapper: script.py was watched up to step (\d+): cannot write the results: File too large; "
    (last,) = re.findall(words + r"the steps before are in own\.unfinished\.csv\n", done.stderr)
    steps = {row["step"] for row in read_table(Path("own.unfinished.csv"))}
    assert steps in (set(range(1, int(last))), set(range(1, int(last) + 1)))
    assert Path("own.csv").read_text() == "of yesterday"


@pytest.mark.parametrize("end", ["", "p.disconnect(c); print('on it goes')"])
def test_a_page_that_cannot_be_written_at_the_end_is_reported(end):
    script(f"c = steps(3)\n{FULL}\n{end}")
    Path("own.html").write_text("of yesterday")
    done = watch("--html", "own.html", "script.py")
    assert (done.returncode, done.stdout) == (2, "on it goes\n" if end else "")
    last = "overlapper: script.py was watched up to step 3: cannot write the results: File too large"
    assert done.stderr.splitlines()[-1] == last and "Written" not in done.stderr
    assert Path("own.html").read_text() == "of yesterday"


def test_shapes_that_cannot_be_read_end_the_watch_and_not_the_script():
    script("import tempfile; tempfile.tempdir = '/no/such/folder'\nsteps(9); print('on it goes')")
    done = watch("script.py")
    assert (done.returncode, done.stdout) == (2, "on it goes\n")
    assert re.fullmatch(
        r"overlapper: script.py was watched up to step 1: .* cannot hand over its shapes, .* temporary file .*\n",
        said(done),
    )


def test_the_module_is_the_command():
    script("steps(3); print(sys.argv)")
    module = run(sys.executable, "-m", "overlapper.watch", "--out", "own.csv", "script.py", "--x")
    assert (module.returncode, module.stdout) == (0, "['script.py', '--x']\n")
    assert "Written: own.csv" in module.stderr
    assert "Usage: overlapper watch" in run(sys.executable, "-m", "overlapper.watch", "--help").stdout


PYBULLET = Path(__import__("pybullet_data").__file__).parents[1]
EXAMPLES = {
    "pybullet_examples/jacobian.py": ([], 1),
    "pybullet_examples/sleeptest.py": (["--direct"], 5),
    "pybullet_robots/panda/loadpanda.py": (["--direct"], 5),
}


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_of_pybullet_are_watched_unchanged(example):
    options, least = EXAMPLES[example]
    command = [*COMMAND, "watch", *options, "--out", "own.csv", "--html", "own.html", "--json", str(PYBULLET / example)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            _, complaints = process.communicate(timeout=10 if options else 60)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            _, complaints = process.communicate(timeout=30)
    answer = json.loads(complaints.splitlines()[-1])
    assert answer["simulations"][0]["measured"] >= least
    assert read_metadata(Path("own.csv"))["simulation"] == Path(example).name
    assert Path("own.html").stat().st_size > 100_000
