"""Ways to search for contingent plans, found by name."""

from planner.strategies.registry import STRATEGIES, Found, Strategy, Task, strategy_named

__all__ = ["STRATEGIES", "Found", "Strategy", "Task", "strategy_named"]
