"""What holds for every test."""

from hypothesis import settings

from tests.seeds import JUDGED

# Machines differ and are shared: no test is judged by its time.
settings.register_profile("outcrop", deadline=None, derandomize=JUDGED)
settings.load_profile("outcrop")
