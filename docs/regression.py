"""Makes docs/regression.png: the page of before and after of a scene of examples/ci whose model has been changed.

python docs/regression.py
"""

import asyncio
import base64
import json
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

from picture import HERE
from tornado.websocket import websocket_connect

SECONDS = 20  # for both recordings to be drawn


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        repository = shutil.copytree(HERE.parent / "examples" / "ci", Path(folder, "mine"))
        model = repository / "models" / "drawer.urdf"
        model.write_text(model.read_text(encoding="utf-8").replace("0.5 0.396 0.015", "0.5 0.398 0.015"))
        subprocess.run([sys.executable, "-m", "overlapper", "check", "scenes"], cwd=repository)
        asyncio.run(screenshot(repository / "out" / "drawer.moved.html", HERE / "regression.png"))


async def screenshot(page: Path, picture: Path) -> None:
    """What Chromium shows of a page and its frames, which are targets of their own: --screenshot comes too early."""
    options = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run"]
    options += ["--enable-unsafe-swiftshader", "--remote-debugging-port=0", "--window-size=1280,1000"]
    with tempfile.TemporaryDirectory() as profile:
        command = ["chromium", *options, f"--user-data-dir={profile}", page.as_uri()]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as browser:
            host = next(filter(None, (re.search(r"listening on ws://([^/]+)", line) for line in browser.stderr or [])))
            await asyncio.sleep(SECONDS)
            with urllib.request.urlopen(f"http://{host[1]}/json") as answer:
                (top,) = [each for each in json.load(answer) if each["type"] == "page"]
            connection = await websocket_connect(top["webSocketDebuggerUrl"], max_message_size=1 << 28)
            await connection.write_message(json.dumps({"id": 1, "method": "Page.captureScreenshot"}))
            picture.write_bytes(base64.b64decode(json.loads(await connection.read_message())["result"]["data"]))
            connection.close()
            browser.kill()
    print(picture)


if __name__ == "__main__":
    main()
