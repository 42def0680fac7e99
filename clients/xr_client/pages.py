"""The page's files and the CA's certificate over HTTP, with headers that keep the page to this server.

Where an emulated headset was asked for, `/emulate` is the same page with that headset's two scripts before its own. It
is nowhere else: a person who opens `/` in a headset must never meet an emulated one.

Every answer forbids the browser to load or connect to anything from elsewhere, to run code that is not in a file of
ours, and to show the page inside another one.
"""

import mimetypes
from collections.abc import Callable
from pathlib import Path

from aiohttp import web

WEB = Path(__file__).parent / "web"
"""Where the page's files are."""

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob:; connect-src 'self'; object-src 'none'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "xr-spatial-tracking=(self), camera=(), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Server": "ik-xr",
}
EMULATOR = "emulator"
"""Folder of the files that belong to the emulated headset, and name under which they are served."""

_EMULATOR_TAGS = (
    f'<link rel="stylesheet" href="{EMULATOR}/emulator.css">\n'
    f'<script src="{EMULATOR}/iwer.js"></script>\n'
    f'<script type="module" src="{EMULATOR}/main.js"></script>\n'
)
_TYPES = {".js": "text/javascript", ".mjs": "text/javascript", ".css": "text/css", ".html": "text/html"}


class Pages:
    """Serves the files of a folder, read when asked for, and the CA's certificate."""

    def __init__(self, folder: Path = WEB, ca_der: bytes | None = None, emulator: Path | None = None) -> None:
        """Look at nothing yet.

        Args:
            folder: The page's files.
            ca_der: The CA's certificate; None where there is none to install.
            emulator: IWER's script, to serve the page with an emulated headset as well; None serves nothing of that.
        """
        self._folder = folder.resolve()
        self._ca_der = ca_der
        self._emulator = emulator

    def add_to(self, router: web.UrlDispatcher) -> None:
        """Add the routes; those of others must come first."""
        router.add_get("/ca.crt", self._ca)
        if self._emulator is not None:
            router.add_get("/emulate", self._emulate)
        router.add_get("/{path:.*}", self._file)

    async def _ca(self, _: web.Request) -> web.Response:
        if self._ca_der is None:
            return web.Response(status=404, text="there is no certificate to install on this address\n")
        # Headsets offer to install a certificate of this type.
        return web.Response(body=self._ca_der, content_type="application/x-x509-ca-cert")

    async def _emulate(self, _: web.Request) -> web.Response:
        index = self._folder / "index.html"
        if not index.is_file():
            return _nothing()
        # Scripts that are modules run in the order of the page, so the headset is there when the page looks for it.
        before, script, after = index.read_text(encoding="utf-8").partition("<script")
        return web.Response(text=before + _EMULATOR_TAGS + script + after, content_type="text/html", charset="utf-8")

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["path"] or "index.html"
        if self._emulator is not None and name == f"{EMULATOR}/iwer.js":
            return _content(self._emulator)
        file = (self._folder / name).resolve() if "\0" not in name else self._folder
        if not (file.is_relative_to(self._folder) and file.is_file()):
            return _nothing()
        if self._emulator is None and file.is_relative_to(self._folder / EMULATOR):
            return _nothing()
        return _content(file)


def _content(file: Path) -> web.Response:
    kind = _TYPES.get(file.suffix) or mimetypes.guess_type(file.name)[0] or "application/octet-stream"
    charset = "utf-8" if kind.startswith("text/") else None
    return web.Response(body=file.read_bytes(), content_type=kind, charset=charset)


def _nothing() -> web.Response:
    return web.Response(status=404, text="there is no such page here\n")


@web.middleware
async def with_headers(request: web.Request, handler: Callable) -> web.StreamResponse:
    """Add the headers to whatever is answered, refusals included; say no more about an error than its number."""
    try:
        response = await handler(request)
    except web.HTTPException as refusal:
        response = web.Response(status=refusal.status, text=f"{refusal.reason}\n")
    if not response.prepared:
        response.headers.update(HEADERS)
    return response
