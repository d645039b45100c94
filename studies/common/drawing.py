"""Vector pictures of the docs: colours, text that stays text, the same file for the same picture."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt

mpl.rcParams.update({"svg.hashsalt": "outcrop", "svg.fonttype": "none", "font.family": "sans-serif"})
INK, PAPER, BLUE, ORANGE, GREY = "#263238", "#ffffff", "#1565c0", "#e65100", "#90a4ae"


def save(path: Path) -> None:
    """Write the picture without a date, so that the same picture is the same file."""
    plt.savefig(path, format="svg", metadata={"Date": None}, bbox_inches="tight", facecolor=PAPER)
    plt.close()
    path.write_text("\n".join(line.rstrip() for line in path.read_text().splitlines()) + "\n")
