"""A uvicorn server that wakes twice a second in silence instead of ten times."""

from __future__ import annotations

import asyncio

import uvicorn

TICK_S = 0.5
"""A signal to end is heard so late, and the header `Date` is so old."""


class CalmServer(uvicorn.Server):
    """Waking was most of what a server cost that nobody asks anything: 0.2 % of a core."""

    async def main_loop(self) -> None:
        """Do at each tick what uvicorn does at every tenth of its own."""
        while not await self.on_tick(0):
            await asyncio.sleep(TICK_S)
