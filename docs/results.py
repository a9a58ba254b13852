"""Makes docs/results.png: the volumes of a run over time, as pandas reads them from its table.

python docs/results.py
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import pandas
from matplotlib.figure import Figure

HERE = Path(__file__).parent


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder, "grasp.csv")
        scene = HERE.parent / "scenes" / "franka_grasp.py"
        subprocess.run([sys.executable, "-m", "overlapper", "run", str(scene), "--out", str(table)], check=True)
        rows = pandas.read_csv(table, comment="#")
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    axes = figure.subplots()
    for pair, group in rows[rows.volume_m3 > 0].groupby(["nameA", "nameB"]):
        volumes = group.groupby("time_s").volume_m3.sum()
        axes.plot(volumes.index, volumes * 1e6, ".", markersize=4, label=" and ".join(pair))
    axes.set(xlabel="time, s", ylabel="shared volume, cm³")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(HERE / "results.png", dpi=150)
    print(HERE / "results.png")


if __name__ == "__main__":
    main()
