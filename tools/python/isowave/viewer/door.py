"""HTTP at the socket: heads of requests, their time limit, the token, answers.

A connection carries one request. All answers have the same headers and close the connection.
"""

from __future__ import annotations

import asyncio
import hmac
import re
import secrets
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final
from urllib.parse import urlsplit

MAX_HEAD_BYTES: Final = 16384
MAX_FIELDS: Final = 100
HEADERS: Final = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; base-uri 'none'; frame-ancestors 'none'",
    "Cache-Control": "no-store",
}
WHY: Final = {
    303: "the page is elsewhere",
    400: "this is not a request of a browser",
    403: "open the whole URL that was printed",
    405: "only GET and HEAD are understood here",
    408: "the request did not come in time",
    413: "a request must have no body",
    426: "this address is for websockets",
    431: "the head of the request is too long",
    503: "too many connections are open: close one, then try again",
}
_TOKEN = r"[!#$%&'*+.^_`|~0-9A-Za-z-]+"
_REQUEST_LINE: Final = re.compile(rf"({_TOKEN}) (/[!-~]*) HTTP/1\.[01]")
_FIELD: Final = re.compile(rf"({_TOKEN}):[ \t]*([\t -~\x80-\xff]*)")


class Refused(Exception):
    """A request that is answered with an error."""

    def __init__(self, status: int, **headers: str) -> None:
        super().__init__(WHY[status])
        self.status, self.headers = status, headers


@dataclass(frozen=True)
class Request:
    """The head of a request. fields: by their names in lower case."""

    method: str
    path: str  # without the query
    fields: dict[str, list[str]]

    def only(self, name: str) -> str:
        """The value of a field that comes once; "" if it never comes, or several times."""
        values = self.fields.get(name, [])
        return values[0] if len(values) == 1 else ""

    @property
    def has_body(self) -> bool:
        lengths = self.fields.get("content-length", [])
        return "transfer-encoding" in self.fields or any(v.strip("0") for v in lengths)


async def read_head(reader: asyncio.StreamReader) -> tuple[bytes, bytes]:
    """Returns the head of a request, with the empty line at its end, and the bytes behind it.

    Raises Refused; EOFError if the connection ends before the head does.
    """
    got = b""
    while b"\r\n\r\n" not in got:
        if len(got) > MAX_HEAD_BYTES:
            raise Refused(431)
        if got and not got[:1].isalpha():  # no HTTP: TLS, for example
            raise Refused(400)
        part = await reader.read(4096)
        if not part:
            raise EOFError
        got += part
    head, _, rest = got.partition(b"\r\n\r\n")
    if len(head) > MAX_HEAD_BYTES:
        raise Refused(431)
    return head + b"\r\n\r\n", rest


def parse_head(head: bytes) -> Request:
    """Raises Refused."""
    first, *lines = head.decode("latin-1").split("\r\n")[:-2]
    request_line = _REQUEST_LINE.fullmatch(first)
    if request_line is None:
        raise Refused(400)
    if len(lines) > MAX_FIELDS:
        raise Refused(431)
    fields: dict[str, list[str]] = {}
    for line in lines:
        field = _FIELD.fullmatch(line)
        if field is None:
            raise Refused(400)
        fields.setdefault(field[1].lower(), []).append(field[2].strip(" \t"))
    return Request(request_line[1], request_line[2].partition("?")[0], fields)


class Door:
    """Lets in requests with the token, from a page of ours or from no page."""

    def __init__(self, token: str) -> None:
        self.token, self._codes = token, set[str]()

    def make_code(self) -> str:
        """A path that leads to the page once."""
        code = secrets.token_urlsafe(24)
        self._codes.add(code)
        return code

    def may_enter(self, request: Request) -> bool:
        if not hmac.compare_digest(request.path.split("/")[1].encode(), self.token.encode()):
            return False
        host = request.only("host")
        if not re.fullmatch(r"[A-Za-z0-9._\[\]:-]{1,255}", host):
            return False
        return all(_host_of(origin) == host.lower() for origin in request.fields.get("origin", []))

    def takes_code(self, request: Request) -> bool:
        """Whether the request has a code that was not used before."""
        given = request.path[1:].encode() if request.method == "GET" else b""
        known = [code for code in self._codes if hmac.compare_digest(code.encode(), given)]
        self._codes.difference_update(known)
        return bool(known)


def _host_of(origin: str) -> str | None:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return None
    return parts.netloc.lower() if parts.scheme in ("http", "https") else None


def answer(
    status: int,
    body: bytes = b"",
    kind: str = "text/plain; charset=utf-8",
    *,
    with_body: bool = True,
    **headers: str,
) -> bytes:
    """An answer's bytes. with_body: False for HEAD. headers: with _ for -."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    fields = {**HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}
    fields |= {"Connection": "close"} | named
    lines = [f"HTTP/1.1 {status} {HTTPStatus(status).phrase}"]
    lines += [f"{name}: {value}" for name, value in fields.items()]
    return "\r\n".join(lines).encode("latin-1") + b"\r\n\r\n" + (body if with_body else b"")


async def hand_over(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, data: bytes, seconds: float
) -> None:
    """Sends the last of a connection and waits, within a time, until the client has closed it.

    What the client still sends is read: a close with unread bytes would reset the connection,
    which may destroy an answer on its way.
    """

    async def work() -> None:
        writer.write(data)
        await writer.drain()
        writer.write_eof()
        while await reader.read(65536):
            pass

    await asyncio.wait_for(work(), seconds)
