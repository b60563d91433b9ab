"""Rerun's viewer for the browser, on this machine only and talking to nobody else.

rerun-sdk's own rr.serve_web_viewer listens on every interface, and the page reports usage to its makers.
So the page's files are taken once from the viewer program and served here, on the loopback address, with a
policy that lets the browser connect to this machine alone.
"""

from __future__ import annotations

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final
from urllib.parse import quote, urlsplit
from urllib.request import ProxyHandler, build_opener

from rig.view import viewer

POLICY: Final = "connect-src 'self' http://127.0.0.1:* http://localhost:* blob: data:"
_FILES: Final = ("/", "/re_viewer.js", "/re_viewer_bg.wasm", "/sw.js", "/favicon.ico")
_KEPT_HEADERS: Final = ("Content-Type", "rerun-final-length")  # the second feeds the page's progress bar


class WebViewer:
    """The viewer's page on ``port``: held from the beginning, served from ``serve`` on until closed."""

    def __init__(self, preferred: int) -> None:
        """``preferred``: the port, when nobody has it; else any free one."""
        self.url = ""
        self.files = _fetch()
        try:
            self._server = ThreadingHTTPServer((viewer.LOOPBACK, preferred), _handler(self.files))
        except OSError:
            self._server = ThreadingHTTPServer((viewer.LOOPBACK, 0), _handler(self.files))
        self._server.daemon_threads = True
        self._served = False
        self.port = self._server.server_port

    def serve(self, grpc_url: str) -> None:
        """Serve the page, whose address shows what the server at ``grpc_url`` sends."""
        self.url = f"http://{viewer.LOOPBACK}:{self.port}/?url={quote(grpc_url, safe='')}&theme=dark"
        threading.Thread(target=self._server.serve_forever, name="web viewer", daemon=True).start()
        self._served = True

    def close(self) -> None:
        """Stop serving; a page that is open stays open."""
        if self._served:
            self._server.shutdown()
        self._server.server_close()


File = tuple[dict[str, str], bytes]  # headers, contents


def _fetch() -> dict[str, File]:
    """The page's files, about 45 MB, from the viewer program; it runs for a moment only."""
    port = viewer.free_port()
    nobody = viewer.address(viewer.free_port())
    process = viewer.start(["--serve-web", "--web-viewer-port", str(port), nobody], port)
    opener = build_opener(ProxyHandler({}))  # a proxy of the user's is not for loopback addresses
    try:
        files: dict[str, File] = {}
        for path in _FILES:
            with opener.open(f"http://{viewer.LOOPBACK}:{port}{path}", timeout=10) as reply:
                headers = {name: reply.headers[name] for name in _KEPT_HEADERS if name in reply.headers}
                files[path] = headers, reply.read()
        return files
    finally:
        viewer.stop(process)


def _handler(files: dict[str, File]) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = 30

        def do_GET(self) -> None:  # the name that http.server asks for
            found = files.get(urlsplit(self.path).path)
            headers, contents = found or ({"Content-Type": "text/plain"}, b"not found\n")
            self.send_response(200 if found else 404)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(contents)))
            self.send_header("Content-Security-Policy", POLICY)
            self.end_headers()
            self.wfile.write(contents)

        def log_message(self, format: str, *args: Any) -> None:
            """Nothing: the terminal belongs to the flight."""

    return Handler
