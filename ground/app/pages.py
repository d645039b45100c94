"""The built UI at `/`, the plug-in for Open MCT, and the API's documentation as a page of its own."""

from __future__ import annotations

import html
from pathlib import Path

from fastapi import FastAPI, Request
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.types import Receive, Scope, Send

from web import DIST

OPEN_MCT = Path(__file__).with_name("outcrop_openmct.js")
"""Plug-in for Open MCT; it uses the REST interface and the event streams like any other client."""
_IMMUTABLE = "public, max-age=31536000, immutable"
_NO_UI = (
    "<!doctype html><title>Outcrop</title><h1>Outcrop</h1><p>The UI is not built in this installation; "
    "the API is described at <a href='/api/v1/docs'>/api/v1/docs</a>.</p>"
)


class _Page(APIRoute):
    """Stands for every address that nothing else has: there is nothing to change at one."""

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] not in (self.methods or ()):
            raise HTTPException(404, f"there is nothing at {scope['path']}")
        await super().handle(scope, receive, send)


def install_pages(app: FastAPI, dist: Path = DIST) -> None:
    """Serve the UI: its files where they are, its start page for every other address that is not an API."""

    # The application is the request's: what FastAPI keeps of a function that is asked stays with the process.
    @app.get("/api/v1/docs", include_in_schema=False)
    async def docs(request: Request) -> Response:
        return HTMLResponse(docs_page(request.app))

    @app.get("/openmct/outcrop.js", include_in_schema=False)
    async def open_mct() -> Response:
        return FileResponse(OPEN_MCT, media_type="text/javascript", headers={"Cache-Control": "no-cache"})

    async def page(request: Request, path: str) -> Response:
        if path.startswith("api/") or not dist.is_dir():
            if path in {"", "index.html"}:
                return HTMLResponse(_NO_UI)
            raise HTTPException(404, f"there is nothing at {request.url.path}")
        file = _inside(dist, path)
        if file is not None:
            headers = {"Cache-Control": _IMMUTABLE if path.startswith("assets/") else "no-cache"}
            return FileResponse(file, headers=headers)
        if path.startswith("assets/"):
            raise HTTPException(404, f"there is nothing at {request.url.path}")
        return FileResponse(dist / "index.html", headers={"Cache-Control": "no-cache"})

    app.router.add_api_route(
        "/{path:path}", page, methods=["GET"], include_in_schema=False, route_class_override=_Page
    )


def _inside(folder: Path, path: str) -> Path | None:
    """Return the file at a path below a folder, None for anything else."""
    if not path or "\x00" in path:
        return None
    file = (folder / path).resolve()
    return file if file.is_file() and file.is_relative_to(folder.resolve()) else None


def docs_page(app: FastAPI) -> str:
    """Return a page that lists every endpoint with its parameters and answers."""
    document = app.openapi()
    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>Outcrop API</title>",
        "<style>body{font:15px/1.5 system-ui;max-width:60rem;margin:2rem auto;padding:0 1rem}",
        "code{background:#eee;padding:0 .2em}h3{margin-bottom:0}",
        ".m{display:inline-block;min-width:4.5em;font-weight:600;text-transform:uppercase}</style>",
        f"<h1>Outcrop API {html.escape(document['info']['version'])}</h1>",
        "<pre "
        f"style='white-space:pre-wrap;font:inherit'>{html.escape(document['info']['description'])}</pre>",
        "<p><a href='/api/v1/openapi.json'>OpenAPI document</a></p>",
    ]
    for told in document["components"]["parameters"].values():
        name, about = html.escape(told["name"]), html.escape(told["description"])
        parts.append(f"<p>Header <code>{name}</code> of many requests: {about}</p>")
    for path, operations in sorted(document["paths"].items()):
        for method, operation in operations.items():
            parts.append(f"<h3><span class='m'>{method}</span> <code>{html.escape(path)}</code></h3>")
            parts.append(f"<p>{html.escape(operation.get('description', operation.get('summary', '')))}</p>")
            names = [
                f"<code>{html.escape(p['name'])}</code> "
                f"({p['in']}{', required' if p.get('required') else ''})"
                for p in operation.get("parameters", [])
                if "name" in p  # those that many take stand at the top
            ]
            if names:
                parts.append(f"<p>Parameters: {', '.join(names)}</p>")
            parts.append(f"<p>Answers: {', '.join(sorted(operation.get('responses', {})))}</p>")
    return "".join(parts)
