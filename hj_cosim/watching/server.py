"""A web server for one page on this machine: what happens is sent to whoever has it open, from the beginning.

It listens on the loopback alone. The address has a token, without which nothing is answered: neither other users of
the machine nor pages from elsewhere in the same browser look on. Events are server-sent (WHATWG HTML, section 9.2); one
that was missed is asked for again by its number.
"""

import hmac
import secrets
import threading
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from urllib.parse import parse_qs, urlsplit

LOOPBACK = "127.0.0.1"
PORT = 8420  # unless it is taken: then any that is free
PATIENCE = 20.0  # s that may pass until somebody has opened the page
FAREWELL = 2.0  # s that the last events may take to arrive
HEARTBEAT = 1.0  # s between two signs of life, by which a closed page is noticed


class WatchServer:
    """Serves a page and its events until it is closed; whether somebody looks on changes nothing for who publishes."""

    def __init__(self, page: str, port: int = PORT) -> None:
        """Begin to serve.

        Args:
            page: HTML that listens to `events?token=...`.
            port: on the loopback; another one where it is taken.

        Raises:
            OSError: if the loopback cannot be listened on.
        """
        self.token = secrets.token_urlsafe(18)
        self.page = page.encode()
        self._events: list[bytes] = []
        self._news = threading.Condition()
        self._looking, self._delivered, self._is_over = 0, 0, False
        try:
            self._server = _Server((LOOPBACK, port), _Answer)
        except OSError:
            self._server = _Server((LOOPBACK, 0), _Answer)
        self._server.watch = self
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    @property
    def port(self) -> int:
        """Return where it listens."""
        return int(self._server.server_address[1])

    @property
    def address(self) -> str:
        """Return the page's address, its token included."""
        return f"http://{LOOPBACK}:{self.port}/?token={self.token}"

    def publish(self, kind: str, data: str) -> None:
        """Send an event to all who look on, now or later.

        Args:
            kind: its name.
            data: one line.
        """
        with self._news:
            self._events.append(f"id: {len(self._events)}\nevent: {kind}\ndata: {data}\n\n".encode())
            self._news.notify_all()

    def wait_for_page(self, patience: float = PATIENCE) -> bool:
        """Return whether somebody has opened the page, at the latest after so many s."""
        with self._news:
            return self._news.wait_for(lambda: self._looking > 0, patience)

    def close(self) -> None:
        """Let those who look on have all events, and end."""
        with self._news:
            self._news.wait_for(lambda: not self._looking or self._delivered >= len(self._events), FAREWELL)
            self._is_over = True
            self._news.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def __enter__(self) -> "WatchServer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def knows(self, token: str) -> bool:
        """Return whether a token is ours, in the same time whatever is wrong with it."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    def send_events(self, answer: BaseHTTPRequestHandler, first: int) -> None:
        """Write events from a number on, until there will be none or the page is closed."""
        with self._news:
            self._looking += 1
            self._news.notify_all()
        try:
            while True:
                with self._news:
                    if first >= len(self._events) and not self._is_over:
                        self._news.wait(HEARTBEAT)
                    new, over = self._events[first:], self._is_over
                answer.wfile.write(b"".join(new) or b": still here\n\n")
                answer.wfile.flush()
                first += len(new)
                with self._news:
                    self._delivered = max(self._delivered, first)
                    self._news.notify_all()
                if over:
                    return
        finally:
            with self._news:
                self._looking -= 1
                self._news.notify_all()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    allow_reuse_address = False  # a port that somebody listens on is taken
    watch: WatchServer


class _Answer(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.0"  # the connection ends with the answer
    server: _Server

    def do_GET(self) -> None:
        asked, watch = urlsplit(self.path), self.server.watch
        # A page from elsewhere may have its own name point here: then the name it asks for is not ours.
        is_ours = self.headers.get("Host") in (f"{LOOPBACK}:{watch.port}", f"localhost:{watch.port}")
        if not is_ours or not watch.knows(parse_qs(asked.query).get("token", [""])[0]):
            self._begin(HTTPStatus.FORBIDDEN, "text/plain; charset=utf-8")
            self.wfile.write(b"The address that the program printed has a token; take it whole.\n")
        elif asked.path == "/":
            self._begin(HTTPStatus.OK, "text/html; charset=utf-8")
            self.wfile.write(watch.page)
        elif asked.path == "/events":
            self._begin(HTTPStatus.OK, "text/event-stream")
            last = self.headers.get("Last-Event-ID", "")
            with suppress(OSError):  # the page was closed
                watch.send_events(self, int(last) + 1 if last.isdecimal() else 0)
        else:
            self._begin(HTTPStatus.NOT_FOUND, "text/plain; charset=utf-8")

    def _begin(self, status: HTTPStatus, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing: the terminal belongs to the drive."""
