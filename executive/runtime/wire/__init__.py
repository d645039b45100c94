"""A wire for rovers: the protocol `wire/1` (`docs/reference/wire.md`), its two ends, checks of a rover."""

from executive.runtime.wire.address import Address, Keys
from executive.runtime.wire.client import WireRover
from executive.runtime.wire.conversation import Welcome
from executive.runtime.wire.line import WireOptions
from executive.runtime.wire.server import About, RoverServer

__all__ = ["About", "Address", "Keys", "RoverServer", "Welcome", "WireOptions", "WireRover"]
