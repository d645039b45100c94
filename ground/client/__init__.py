"""A client of the REST interface: what the command line and scripts use."""

from ground.client.rest import ApiError, Client, ServerUnreachableError

__all__ = ["ApiError", "Client", "ServerUnreachableError"]
