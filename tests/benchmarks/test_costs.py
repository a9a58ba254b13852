"""Costs of single features: each benchmark runs on a small case and prints its figures."""

import re

from robots import joint, limit, link, urdf

from costs import audit, recording
from harness import command
from stability import graded


def said(capsys, *arguments):
    assert command.main([str(each) for each in arguments]) == 0
    return capsys.readouterr().out


def test_rings_of_a_chain_are_decomposed_and_measured(capsys):
    lines = said(capsys, "concave", 0.9).splitlines()
    assert re.match(r"[\d,]+ triangles, [\d.]+ cm³ each, [\d.]+ cm³ shared", lines[0])
    threshold, parts, _, ring, shared = lines[2].split()[:5]
    assert (float(threshold), int(parts) > 0) == (0.9, True) and float(ring) > float(shared) > 0


def test_a_recording_is_made_and_saved(capsys, monkeypatch):
    monkeypatch.setattr(recording, "BODIES", 8)
    lines = said(capsys, "recording", "mixed", "--steps=4").splitlines()
    assert re.match(r"mixed: 8 bodies, 4 frames, \d+ overlaps: [\d.]+ MB", lines[0])
    assert re.match(r"  recorded: \d+ ms a frame, and \d+ s to save", lines[1])


def test_a_sweep_is_timed_part_by_part(capsys):
    lines = said(capsys, "sweep", 1, "--tasks=4", "--grasps=0").splitlines()
    figures = {line[:20].strip(): float(line[20:27]) for line in lines}
    assert set(figures) == {"a run", "more in the worker", "in the parent", "there and back", "overhead per task"}
    assert figures["a run"] > 0


def test_a_watched_script_is_timed_beside_itself(capsys):
    lines = said(capsys, "watch", 1, "--steps=2", "--scene=r2d2", "--way=every step").splitlines()
    assert lines[0].startswith("r2d2: µs per step") and float(lines[2].split()[2]) > float(lines[1].split()[2]) > 0
    assert re.match(r"start: -?\d+\.\d\d s more", lines[3])


def test_a_long_script_tells_of_its_memory(capsys):
    lines = said(capsys, "watch", "--long=20").splitlines()
    heads = [line for line in lines if line.startswith("every")]
    assert re.match(r"every step, --out \.csv: 20 steps, 1,\d{3} rows, a file of [\d.]+ MB", heads[0])
    assert len({re.search(r"[\d,]+ rows", head)[0] for head in heads}) == 1 and len(heads) == 3
    figures = [[*map(float, line.split())] for line in lines if line not in heads]
    assert len(figures) == 30 and all(taken > 0 and memory > 10 for taken, memory in figures)


def test_logs_of_each_format_tell_of_time_and_memory(capsys):
    lines = said(capsys, "watch", "--log=200").splitlines()
    assert [line.partition(":")[0] for line in lines] == ["csv", "parquet", "sqlite"]
    words = r"\w+: \d+ rows, \d+ a step, [\d.]+ µs each in the loop, [\d.]+ s at the end; the process has grown by "
    assert all(re.match(words + r"-?[\d.]+ MB in the loop, and by -?[\d.]+ MB at most$", line) for line in lines)


def test_a_robot_is_a_row_of_the_table_of_audits():
    cells = audit.row_of(audit.ROBOTS / audit.FRANKA, 4)
    assert len(cells) == 9 and cells[0] == "panda"
    assert int(cells[3]) == sum(map(int, cells[4:8])) > 0


def test_proofs_of_a_robot_are_checked_and_survive_samples(monkeypatch):
    monkeypatch.setattr(audit, "SURVIVED", 2000)
    cells = audit.proofs_of("ur5_robot", 2000)
    assert cells[:1] + cells[4:5] == ["ur5_robot", "3"] and cells[-2:] == ["0", "0"]
    assert int(cells[2]) == sum(map(int, cells[4:7]))


def test_the_pairs_of_an_srdf_file_stand_beside_their_proofs(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(audit, "SAMPLED", 300)
    bodies = [("base", "0 0 0"), ("far", "9 0 0"), ("near", "0.5 0 0"), ("top", "0 0 9")]
    links = [link(name, ("1 1 1", place)) for name, place in bodies]
    bolts = [joint(f"to {name}", "fixed", parent, name) for parent, name in (("base", "far"), ("far", "near"))]
    arm = urdf(tmp_path / "made.urdf", *links, *bolts, joint("turn", "revolute", "near", "top", limit(-1, 1)))
    disabled = [f'<disable_collisions link1="base" link2="{name}" reason="Never"/>' for name in ("near", "top")]
    (tmp_path / "made.srdf").write_text(f'<robot name="made">{"".join(disabled)}</robot>', encoding="utf-8")
    lines = said(capsys, "audit", "moveit", arm, tmp_path / "made.srdf").splitlines()
    assert lines[2] == "| made | 2 | 1 | 1 | 0 | 1 |"
    assert re.match(r"made: base and near overlap in 1 of 1 configurations, by up to 500 mm", lines[3])


def test_hard_cases_are_checked_by_the_rules(capsys, tmp_path):
    words = said(capsys, "stress", "--count=3", "--family=general", "--workers=1", f"--out={tmp_path / 'rows.csv'}")
    assert re.search(r"\| all \| 3 \| \d+ \| \d+ \|.*\| 0 \|\n", words)
    assert len((tmp_path / "rows.csv").read_text(encoding="utf-8").splitlines()) == 4


def test_graded_contacts_go_on_where_a_run_was_stopped(capsys, tmp_path):
    rows = tmp_path / "rows.csv"
    asked = ("graded", "--pairs=ball, ball", "--workers=1", f"--out={rows}")
    assert re.search(r"\| all \| 1 \| 1 \| 0 \|", said(capsys, *asked, "--count=1"))
    first = rows.read_text(encoding="utf-8")
    assert re.search(r"\| all \| 2 \| 2 \| 0 \|", said(capsys, *asked, "--count=2", "--resume"))
    both = rows.read_text(encoding="utf-8")
    assert both.startswith(first) and len(both.splitlines()) == 3


def test_graded_contacts_that_take_too_long_are_counted():
    ran = {"broken": "", "status": "overlapping", "stated": "1e-14", "proof": graded.ENDED}
    line = graded.summary("ball, ball", [ran, {"broken": "not waited for beyond 60 s"}])
    assert [line[name] for name in ("cases", "ran", "out of time", "proved", "proofs out of time", "failures")] == [
        2, 1, 1, 0, 1, 1,
    ]  # fmt: skip
