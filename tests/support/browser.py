"""Headless Chromium through DevTools: evaluates scripts in a page, takes its picture, and clicks on it."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import re
import shutil
import subprocess
import urllib.request
from pathlib import Path

import numpy as np
from PIL import Image
from tornado.websocket import WebSocketClientConnection, websocket_connect

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
OPTIONS = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run"]
OPTIONS += ["--enable-unsafe-swiftshader", "--disable-background-networking"]


class Browser:
    """One page at a time, in one Chromium; whoever waits gets TimeoutError after a minute."""

    def __init__(self, profile: Path, size: tuple[int, int] = (800, 800)) -> None:
        command = [CHROMIUM, *OPTIONS, "--remote-debugging-port=0", f"--user-data-dir={profile}"]
        command += [f"--window-size={size[0]},{size[1]}", "about:blank"]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self._loop = asyncio.new_event_loop()
        self._count = 0
        try:
            self._socket = self._loop.run_until_complete(self._connected(self._address()))
        except BaseException:
            self._end()
            raise
        self("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)

    def _address(self) -> str:
        """Where the page is to be asked, once Chromium has one."""
        listening = (re.search(r"listening on ws://([^/]+)", line) for line in self._process.stderr)
        host = next(filter(None, listening))[1]
        while True:
            with urllib.request.urlopen(f"http://{host}/json", timeout=60) as answer:
                for each in json.load(answer):
                    if each["type"] == "page":
                        return each["webSocketDebuggerUrl"]

    async def _connected(self, address: str) -> WebSocketClientConnection:
        return await asyncio.wait_for(websocket_connect(address, max_message_size=1 << 28), 60)

    def __call__(self, method: str, **parameters: object) -> dict:
        return self._loop.run_until_complete(asyncio.wait_for(self._ask(method, parameters), 60))

    async def _ask(self, method: str, parameters: dict[str, object]) -> dict:
        self._count += 1
        await self._socket.write_message(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            answer = json.loads(await self._socket.read_message())
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                return answer["result"]

    def open(self, address: str, until: str) -> None:
        """Open a page, and wait until the expression is true in it."""
        self("Page.navigate", url="about:blank")  # or another # would not be another page
        self("Page.navigate", url=address)
        self.wait(until)

    def ask(self, expression: str) -> object:
        """The value of an expression, a promise's when it has one."""
        result = self("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def wait(self, condition: str) -> None:
        """Wait until an expression is true, asked before each picture that the page makes."""
        self.ask(
            "new Promise(done => { const look = () => { let there = false;"
            f"try {{ there = !!({condition}); }} catch {{}}"
            "if (there) done(); else requestAnimationFrame(look); }; look(); })"
        )

    def click(self, x: float, y: float) -> None:
        x, y = float(x), float(y)
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def click_on(self, selector: str) -> None:
        """Click on the middle of the first element that the selector finds."""
        box = self.ask(
            f"JSON.parse(JSON.stringify(document.querySelector({json.dumps(selector)}).getBoundingClientRect()))"
        )
        self.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    def press(self, key: str) -> None:
        text = {"text": key} if len(key) == 1 else {}
        self("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self("Input.dispatchKeyEvent", type="keyUp", key=key)

    def settle(self) -> None:
        """Wait until two more frames are drawn: what observes sizes, or draws before the next frame, has done so."""
        self.ask("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def picture(self) -> np.ndarray:
        """(height, width, 3), as it looks once it has settled."""
        self.settle()
        shot = base64.b64decode(self("Page.captureScreenshot")["data"])
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=int)

    def close(self) -> None:
        self._loop.run_until_complete(self._leave())
        self._end()

    async def _leave(self) -> None:
        self._socket.close()

    def _end(self) -> None:
        self._loop.close()
        self._process.kill()
        self._process.communicate()
