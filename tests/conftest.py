"""What holds for every test."""

from hypothesis import settings

# Machines differ and are shared: no test is judged by its time.
settings.register_profile("outcrop", deadline=None)
settings.load_profile("outcrop")
