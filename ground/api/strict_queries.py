"""Routes that answer 400 to parameters that cannot be used, as the standards of OGC have it."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from starlette.responses import Response

from ground.api.context import Route
from ground.errors import InvalidInputError, UnusableQueryError


class StrictRoute(Route):
    """A route on which an unknown parameter, and a value that cannot be used, is answered with 400."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request."""
        handle = super().get_route_handler()

        async def strict(request: Request) -> Response:
            try:
                return await handle(request)
            except InvalidInputError as err:
                raise UnusableQueryError(err.message, pointer=err.pointer) from err
            except RequestValidationError as err:
                first = err.errors()[0]
                where = str(first["loc"][-1])
                raise UnusableQueryError(f"{where}: {first['msg']}", pointer=where) from err

        return strict
