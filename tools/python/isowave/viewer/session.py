"""A front end's connection, by websocket or by a notebook's kernel."""

from __future__ import annotations

import time
from collections.abc import Callable

from .protocol import Hello, ProtocolError, TokenBucket, check
from .scene import Scene
from .turns import Client, Post


class TooManyClients(ProtocolError):
    """The scene has as many clients as it may have."""


class Session:
    """Checks a front end's messages, limits their rate, and hands them to the scene.

    post    as Client's
    rate    most messages a second; burst: most at once
    """

    def __init__(
        self,
        scene: Scene,
        post: Post,
        *,
        rate: float = 250,
        burst: float = 500,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._scene, self._post = scene, post
        self._bucket = TokenBucket(rate, burst, clock)
        self._client: Client | None = None
        self._closed = False

    def receive(self, content: object) -> None:
        """Takes a message's JSON object. Raises ProtocolError: close the connection then."""
        if self._closed:
            return
        if not self._bucket.take():
            raise ProtocolError("too many messages")
        message = check(content)
        if isinstance(message, Hello):
            if self._client is not None:
                raise ProtocolError("a second hello")
            self._client = self._scene.join(self._post)
            if self._client is None:
                raise TooManyClients("too many clients are connected; close another one first")
        elif self._client is None:
            raise ProtocolError("the first message must be hello")
        else:
            self._scene.receive(self._client, message)

    @property
    def has_joined(self) -> bool:
        """Whether the front end has said hello."""
        return self._client is not None

    def close(self) -> None:
        """Ends the session. May be called twice."""
        self._closed = True
        if self._client is not None:
            self._scene.leave(self._client)
            self._client = None
