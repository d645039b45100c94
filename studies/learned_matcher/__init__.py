"""A descriptor of patches learned on rendered ground under changed light, against SIFT.

`python -m studies.learned_matcher --help` names the commands; docs/results/tracking.md has the table.
"""
