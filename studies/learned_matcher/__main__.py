"""A learned descriptor of patches against SIFT: see docs/results/tracking.md.

    python -m studies.learned_matcher pairs --worlds 11            # patches of training seeds
    python -m studies.learned_matcher train --minutes 7            # needs studies/learned_matcher.txt
    python -m studies.learned_matcher table --worlds 10 --out docs # fresh seeds, printed; writes the table
    python -m studies.learned_matcher table --worlds 4 --tuning    # seeds that ratios were set on;
    writes nothing

Each goes on where it was stopped: `pairs` by world, `train` from its last checkpoint, `table` by `--seed` as
it was printed. Minutes are of one processor. `train` writes `descriptor.onnx` into the folder; the one that
ships, and that the table is of, is in `rover_iface/vision/learned`, with a note of how it was made.

The network follows L2-Net and HardNet (Mishchuk et al. 2017, "Working hard to know your neighbor's margins"):
a grey patch (32, 32) of zero mean and unit deviation becomes, by seven convolutions, a unit vector (64,), and
training pulls both views of a point together and away from the nearest other point of the batch. It is an
eighth as deep as theirs, so that a picture's keypoints take a part of a second in OpenCV's dnn. Domain (d)
needs `studies/offscreen.txt`; `--domains draped photographs warped` does without.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from rover_iface.vision.learned.descriptor import FILE

IMAGERY = Path(__file__).resolve().parents[2].parent / "shared/data/imagery"


def main() -> None:
    """Run one part of the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("part", choices=("pairs", "train", "table"))
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "learned_matcher")
    parser.add_argument("--imagery", type=Path, default=IMAGERY)
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--domains", nargs="+")
    parser.add_argument("--network", type=Path, default=FILE)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    if arguments.part == "pairs":
        from studies.learned_matcher.pairs import make_pairs

        make_pairs(arguments.worlds, arguments.imagery, arguments.folder)
    elif arguments.part == "train":
        from studies.learned_matcher.training import train

        train(arguments.folder, arguments.minutes, 0 if arguments.seed is None else arguments.seed)
    else:
        from studies.learned_matcher.table import make_table

        make_table(arguments)


if __name__ == "__main__":
    main()
