"""Parts of a brute-force count."""

from __future__ import annotations

from studies.rare_failures import chunks


def test_the_parts_of_a_count_are_as_many_runs_as_were_asked_for() -> None:
    for runs in (1, 4_999, 5_000, 12_345):
        parts = chunks(77, runs)
        assert [seed for first, count in parts for seed in range(first, first + count)] == list(
            range(77, 77 + runs)
        )
