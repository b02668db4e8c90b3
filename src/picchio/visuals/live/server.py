"""The page's other end: a server on this machine alone, one page and one socket.

It listens on 127.0.0.1 and a port that the system chooses; the address has a random word in it,
and what does not come from that page is refused, so that no other page of the browser can ask.
On a JupyterHub the browser is elsewhere: jupyter-server-proxy leads there, under the hub's name.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import secrets
import threading
from collections.abc import Iterator
from typing import Any

import numba
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from picchio.core.errors import PicchioError
from picchio.visuals.live.gesture import Gesture
from picchio.visuals.live.session import COARSE, FINE, Session
from picchio.visuals.scene.page import POLICY

_STILL = 0.35  # s without a gesture: the hand rests
# Where notebooks show pages that run on this machine.
_NOTEBOOKS = "http://127.0.0.1:* http://localhost:* vscode-webview:"
_LONGEST = 100_000  # bytes of a message


class Server:
    """Serves one page and answers its gestures, in a thread of its own.

    Args:
        session: what is explored.
        page: HTML.
    """

    def __init__(self, session: Session, page: str) -> None:
        self.session, self._page = session, page
        self._word = secrets.token_urlsafe(12)
        self._sockets: set[_Socket] = set()
        self._asked = asyncio.Event()
        self._gestures: list[Gesture] = []
        self._ball: tuple[int, Iterator[dict[str, Any] | None]] | None = None
        self.hub = os.environ.get("JUPYTERHUB_SERVICE_PREFIX", "").rstrip("/")
        self.port = 0
        self.framed = False  # whether a notebook shows it
        self._ready = threading.Event()
        self._failed: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="picchio explore", daemon=True)

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self.port}/{self._word}/"

    @property
    def address(self) -> str:
        """Where a browser finds it: its url, or its path on the hub."""
        return f"{self.hub}/proxy/{self.port}/{self._word}/" if self.hub else self.url

    @property
    def alive(self) -> bool:
        """Whether it answers."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Begin to serve; returns when the page can be opened.

        Raises:
            OSError: no port can be had.
        """
        self._thread.start()
        self._ready.wait()
        if self._failed is not None:
            raise self._failed

    def stop(self) -> None:
        """End; pages that are open say so."""
        if self.alive:
            self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        numba.set_num_threads(1)  # of this thread: small work, and others want the cores
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            self._failed = error
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        self._loop, self._end = asyncio.get_running_loop(), asyncio.Event()
        sockets = bind_sockets(0, "127.0.0.1")
        self.port = sockets[0].getsockname()[1]
        handlers = [(f"/{self._word}/", _Page, {"server": self}),
                    (f"/{self._word}/live", _Socket, {"server": self})]  # fmt: skip
        server = HTTPServer(
            Application(handlers, log_function=lambda _: None,  # type: ignore[arg-type]
                        websocket_max_message_size=_LONGEST)
        )  # fmt: skip
        server.add_sockets(sockets)
        work = asyncio.create_task(self._work())
        self._ready.set()
        await self._end.wait()
        work.cancel()
        server.stop()
        for socket in list(self._sockets):
            socket.close(1001, "picchio has ended")
        await asyncio.sleep(0.05)

    # --- answers ----------------------------------------------------------------------------
    def ask(self, gesture: Gesture) -> None:
        """Take a gesture; it is answered in its turn.

        Args:
            gesture: as `Session.take` has it.
        """
        self._gestures.append(gesture)
        self._asked.set()

    async def _work(self) -> None:
        while True:
            await self._asked.wait()
            self._asked.clear()
            while self._gestures:
                gesture = self._gestures.pop(0)
                began = self._loop.time()
                try:
                    self.session.take(gesture)
                    problem = None
                except Exception as error:  # the page waits for an answer, whatever it is
                    problem = _problem(error)
                self.tell(answers=gesture.id, problem=problem, began=began)
                await asyncio.sleep(0)
                # A piece of the envelope at a time: the next gesture may be waiting.
                await self._draw(COARSE, pieces=1)
            # What was begun is of an earlier place: once more, of where the tool stands now.
            if await self._draw(COARSE) and await self._draw(COARSE):
                await self._settle()

    async def _settle(self) -> None:
        """What takes longer, once no hand moves."""
        try:
            await asyncio.wait_for(self._asked.wait(), _STILL)
            return
        except TimeoutError:
            pass
        try:
            for _ in self.session.settle():
                await asyncio.sleep(0)
                if self._gestures:
                    return
        except Exception as error:
            self.tell(problem=_problem(error))
            return
        self.tell(settled=True)
        await self._draw(FINE)

    async def _draw(self, subdivisions: int, pieces: int = 1000) -> bool:
        """Work on the envelope; False where a gesture came first, or more is left to do."""
        if self._ball is None or self._ball[0] != subdivisions:
            self._ball = subdivisions, self.session.balls(subdivisions)
        for _ in range(pieces):
            try:
                ball = next(self._ball[1])
            except Exception:  # at its end; the values tell what is wrong
                self._ball = None
                return True
            if ball is not None:
                self._send({"ball": ball})
                self._ball = None
                return True
            await asyncio.sleep(0)
            if self._gestures:
                return False
        return False

    def tell(
        self,
        *,
        answers: Any = None,
        settled: bool = False,
        problem: str | None = None,
        began: float | None = None,
    ) -> None:
        """Send all numbers to every page.

        Args:
            answers: number of the gesture.
            settled: see `Session.values`.
            problem: what was wrong with the gesture.
            began: when work on it began, s of the loop's clock.
        """
        content = self.session.values(settled) | {"answers": answers, "problem": problem}
        if began is not None:
            content["took"] = 1e3 * (self._loop.time() - began)
        self._send({"values": content})

    def _send(self, content: dict[str, Any]) -> None:
        text = json.dumps(content, allow_nan=False)
        for socket in list(self._sockets):
            try:
                socket.write_message(text)
            except WebSocketClosedError:
                self._sockets.discard(socket)

    def own(self, host: str) -> bool:
        """Whether a request names this server, and no name that leads here but a hub's.

        Args:
            host: as the request says it.
        """
        return bool(self.hub) or host in (f"127.0.0.1:{self.port}", f"localhost:{self.port}")


class _Page(RequestHandler):
    def initialize(self, server: Server) -> None:
        self._server = server

    def get(self) -> None:
        if not self._server.own(self.request.host):
            raise HTTPError(403)
        where = self.request.host
        # A notebook that shows it is a page of this machine; else nobody frames it.
        notebooks = "'self'" if self._server.hub else _NOTEBOOKS
        frames = notebooks if self._server.framed else "'none'"
        sockets = f"wss://{where} ws://{where}" if self._server.hub else f"ws://{where}"
        self.set_header(
            "Content-Security-Policy",
            f"{POLICY}; connect-src {sockets}; frame-ancestors {frames}",
        )
        if not self._server.framed:
            self.set_header("X-Frame-Options", "DENY")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")
        self.set_header("Referrer-Policy", "no-referrer")
        self.finish(self._server._page)


class _Socket(WebSocketHandler):
    def initialize(self, server: Server) -> None:
        self._server = server

    def check_origin(self, origin: str) -> bool:
        ways = ("http", "https") if self._server.hub else ("http",)
        return origin in [f"{way}://{self.request.host}" for way in ways]

    def prepare(self) -> None:
        # Tornado asks `check_origin` only where there is an origin.
        origin = self.request.headers.get("Origin", "")
        if not self._server.own(self.request.host) or not self.check_origin(origin):
            raise HTTPError(403)

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        self._server._sockets.add(self)
        self._server.ask(Gesture())

    def on_close(self) -> None:
        self._server._sockets.discard(self)

    def on_message(self, message: str | bytes) -> None:
        server = self._server
        try:
            gesture = Gesture.of(message)
        except PicchioError as error:
            # Its number, where it has one that can be read, so that the page asks on.
            found = re.search(r'"id"\s*:\s*(\d{1,15})\b', str(message))
            server.tell(answers=int(found[1]) if found else None, problem=str(error))
            return
        if not (gesture.write or gesture.toml):
            server.ask(gesture)
            return
        session, said = server.session, {}
        try:
            if gesture.write:
                said = {"written": str(session.file), "poses": session.add()}
            else:
                said = {"toml": session.toml()}
        except Exception as error:
            said = {"problem": _problem(error)}
        self.write_message(json.dumps({"file": said}))


def _problem(error: Exception) -> str:
    """What a page says of an error; one that is not ours is a fault of the program."""
    return str(error) if isinstance(error, PicchioError) else f"cannot be answered: {error!r}"
