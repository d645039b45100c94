"""Running a plan: on the virtual clock of a simulated rover or on the wall clock, with a journal."""

from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.run import run_plan
from executive.runtime.session import RunOutcome, Session

__all__ = ["LiveRuntime", "LiveSettings", "RunOutcome", "Session", "run_plan"]
