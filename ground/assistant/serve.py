"""The tools as an MCP server, over standard input and output or over HTTP on loopback."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING

from ground.assistant.marking import NOTICE, handed
from ground.assistant.tools import READING, Tools
from ground.client import ApiError, Client
from ground.errors import ForbiddenError, UnavailableError
from mission.codec import Document

if TYPE_CHECKING:
    from mcp.server import MCPServer

MISSING = "a server for assistants needs mcp: pip install 'outcrop[assistant]'"
LOOPBACK = "127.0.0.1"
"""The one address it listens on: its callers are not asked who they are."""
MAX_BODY = 1 << 20
"""Bytes of one message; the largest draft, a keep-out of 500 corners, has a fiftieth of it."""
NARROWED = "narrowed-key"
"""The problem by which a server refuses a narrowed key what is its owner's matter."""


def require_narrowed(client: Client) -> None:
    """Raise unless the server says that the key is a narrowed one: another refusal is not proof of it.

    Raises
    ------
    ForbiddenError
        If whoever has it may do all that its owner may.
    ApiError
        If the server, or something between, refuses for another reason.
    """
    try:
        client.list_api_keys()
    except ApiError as err:
        if err.status == 403 and err.kind == NARROWED:
            return
        raise
    raise ForbiddenError(
        "the key of an assistant has to be narrowed; make one with `outcrop api-key add NAME "
        "--role assistant` and give it as OUTCROP_API_KEY"
    )


def make_server(client: Client) -> MCPServer[object]:
    """Return the server of the tools over a client.

    Raises
    ------
    UnavailableError
        If mcp is not installed.
    """
    try:
        from mcp.server import MCPServer
        from mcp.server.mcpserver.exceptions import ToolError
        from mcp.types import ToolAnnotations
    except ImportError as err:
        raise UnavailableError(MISSING) from err

    def telling(tool: Callable[..., Document]) -> Callable[..., Document]:
        @wraps(tool)
        def told(*args: object, **kwargs: object) -> Document:
            try:
                return tool(*args, **kwargs)
            except ApiError as err:
                raise ToolError(_refusal(err, status=err.status, kind=err.kind)) from err
            except Exception as err:  # what a library says of a plan's text is text of others too
                raise ToolError(_refusal(err)) from err

        return told

    server: MCPServer[object] = MCPServer(
        "outcrop", instructions=f"Read a rover's mission and draft for it. People decide on drafts. {NOTICE}"
    )
    for name, tool in Tools(client).named().items():
        hints = ToolAnnotations(read_only_hint=name in READING, destructive_hint=False)
        server.add_tool(telling(tool), name=name, annotations=hints)
    return server


def _refusal(err: Exception, **more: object) -> str:
    """Return why a tool gave no answer, in the form of its answers: messages quote texts of others."""
    return json.dumps(handed({"refused": str(err), **more}))


def serve(client: Client, http_port: int | None) -> None:
    """Serve until the other side ends: over standard input and output, or HTTP at a port of loopback."""
    server = make_server(client)
    if http_port is None:
        server.run("stdio")
    else:
        server.run("streamable-http", host=LOOPBACK, port=http_port, max_request_body_size=MAX_BODY)
