"""Real frames beside rendered ones, and a classifier that tells them apart: docs/results/pictures.md.

    .venv/bin/pip install -r studies/telling_apart.txt
    .venv/bin/python -m studies.picture_page --out docs     a quarter of an hour of one core

Each real frame has rendered partners of its camera, height, tilt and, where its label tells it, sun, over
terrains of their own: default and sandy look on ground without a geology, and ground of the geology that is
called after the frame's place; seeds follow from the one printed, drawn when none is given. The classifiers
see statistics of 64 px patches of ground; all frames of the judged place, and the partners of these, are
kept from them.
"""

from __future__ import annotations

import argparse
import secrets
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.simulator.render.look import SANDY, Look
from studies.common.pages import table, write_section
from studies.common.patch_statistics import NAMES, PATCH_PX, half_size, patch_statistics
from studies.common.real_frames import FRAMES, IMAGERY, RealFrame, View, load_view
from studies.common.rendered_like import Rendered, rendered_like
from studies.common.telling_apart import (
    Fold,
    Kernel,
    Scenes,
    Verdict,
    crossed,
    feature_aucs,
    paired,
    tell_apart,
)
from studies.common.texture_statistics import stretch

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
LOOKS: Mapping[str, Look | None] = {"default": Look(), "sandy": SANDY, "geology": None}
SIZES = "full", "half"
KERNELS: tuple[Kernel, ...] = "linear", "rbf"
PATCHES = 64
"""Most patches of one picture: more of the same ground say little new."""

SHOWN_STATISTICS = 14
RANGED = "SIFT per Mpx", *(name for name in NAMES if name.startswith("spectrum slope"))
"""Statistics whose range over real frames the rendered ones should keep."""

TILE_PX = 260
SHEETS = {
    "pictures-spirit": ("Spirit",),
    "pictures-rovers": ("Opportunity", "Curiosity", "Perseverance"),
    "pictures-apollo": ("Apollo 17",),
}


@dataclass
class Measured:
    """Patch statistics by kind of picture ("real", or a look) and size, then scene; tiles to be shown."""

    values: dict[tuple[str, str], dict[str, list[Array]]] = field(default_factory=dict)
    tiles: dict[str, list[npt.NDArray[np.uint8]]] = field(default_factory=dict)

    def add(self, kind: str, scene: str, image: npt.NDArray[np.float32], ground: Mask, seed: int) -> None:
        """Measure a picture at both sizes; a size at which no patch fits into the ground is left out."""
        for size in SIZES:
            rng = np.random.default_rng([seed, 0x9A7C])
            shown, mask = (image, ground) if size == "full" else half_size(image, ground)
            try:
                found = patch_statistics(shown, mask, most=PATCHES, rng=rng)
            except ValueError:
                continue
            self.values.setdefault((kind, size), {}).setdefault(scene, []).append(found.values)

    def scenes(self, kind: str, size: str, frames: Sequence[RealFrame]) -> dict[str, Array]:
        """Return the statistics of all pictures of each scene of these frames."""
        wanted = {frame.scene for frame in frames}
        return {
            name: np.concatenate(parts)
            for name, parts in self.values[kind, size].items()
            if name.split("/")[0] in wanted
        }


def measure_all(frames: Sequence[RealFrame], per_frame: int, seed: int) -> Measured:
    """Return the statistics of real frames and of their rendered partners, showing progress."""
    seeds = np.random.default_rng(seed)
    measured = Measured()
    for number, frame in enumerate(frames, 1):
        began = time.process_time()
        view = load_view(frame)
        measured.add("real", frame.scene, view.image, view.ground, number)
        for turn in range(per_frame if frame.of_mars else 1):
            site = int(seeds.integers(1 << 31))
            partners = rendered_like(view, site, LOOKS)
            for look, partner in partners.items():
                # every second picture is of another half: the control of rendered against rendered
                measured.add(look, f"{frame.scene}/{turn % 2}", partner.image, partner.ground, site)
            if turn == 0 and frame.shown:
                measured.tiles[frame.name] = _tiles(view, partners)
        spent = time.process_time() - began
        print(f"{number:2d} of {len(frames)}  {frame.name}  {spent:.0f} s of processor", flush=True)
    return measured


def _tiles(view: View, partners: Mapping[str, Rendered]) -> list[npt.NDArray[np.uint8]]:
    """Return the real picture and its partners, each stretched over its ground and fitted into a square."""
    import cv2

    tiles = []
    for image, ground in ((view.image, view.ground), *((p.image, p.ground) for p in partners.values())):
        grey = stretch(image, mask=ground).astype(np.uint8)
        scale = TILE_PX / max(grey.shape)
        small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        tile = np.full((TILE_PX + 4, TILE_PX + 4), 255, np.uint8)
        tile[: small.shape[0], : small.shape[1]] = small
        tiles.append(tile)
    return tiles


@dataclass(frozen=True)
class Question:
    """Two kinds of pictures and the folds by which they are told apart."""

    text: str
    first: Scenes
    second: Scenes
    folds: Sequence[Fold]


def questions(measured: Measured, size: str, frames: Sequence[RealFrame]) -> list[Question]:
    """Return what is asked at one size: real against rendered by look, then the controls."""
    mars = [f for f in frames if f.of_mars]
    asked = [
        _against_rendered(f"Mars frames against rendered, {look} look", measured, look, size, mars)
        for look in LOOKS
    ]
    if len(mars) < len(frames):
        asked += [
            _against_rendered(f"with Devon Island and Apollo, {look} look", measured, look, size, frames)
            for look in LOOKS
        ]
    rendered = measured.scenes("default", size, mars)
    halves = [{n: v for n, v in rendered.items() if n.endswith(f"/{k}")} for k in range(2)]
    if halves[1]:
        partner = {n.replace("/1", ""): v for n, v in halves[1].items()}
        own = {n.replace("/0", ""): v for n, v in halves[0].items() if n.replace("/0", "") in partner}
        asked.append(
            Question("control: rendered against rendered, other terrains", own, partner, paired(own, partner))
        )
    for text, missions, others in (
        ("control: Spirit against Opportunity", ("Spirit",), ("Opportunity",)),
        (
            "control: Spirit and Opportunity against Curiosity and Perseverance",
            ("Spirit", "Opportunity"),
            ("Curiosity", "Perseverance"),
        ),
        (
            "control: Mars against Devon Island and the Moon",
            ("Spirit", "Opportunity", "Curiosity", "Perseverance"),
            ("Devon Island", "Apollo 17"),
        ),
    ):
        first, second = (
            measured.scenes("real", size, [f for f in frames if f.mission in names])
            for names in (missions, others)
        )
        if len(first) > 1 and len(second) > 1:
            asked.append(Question(text, first, second, crossed(first, second)))
    return asked


def _against_rendered(
    text: str, measured: Measured, look: str, size: str, frames: Sequence[RealFrame]
) -> Question:
    rendered = measured.scenes(look, size, frames)
    real = {
        name: values
        for name, values in measured.scenes("real", size, frames).items()
        if any(other.startswith(f"{name}/") for other in rendered)
    }
    return Question(text, real, rendered, paired(real, rendered))


def _row(question: Question, size: str, verdicts: Sequence[Verdict]) -> list[str]:
    return [
        question.text,
        size,
        *(f"{100 * v.mean:.0f} % ({100 * v.low:.0f} to {100 * v.high:.0f})" for v in verdicts),
        str(len(question.folds)),
    ]


def verdict_table(
    asked: Mapping[str, Sequence[Question]], seed: int
) -> tuple[str, dict[tuple[str, str], Verdict]]:
    """Return the table of accuracies, and the verdicts of the curved machine by question and size."""
    rows, kept = [], {}
    for size, several in asked.items():
        for question in several:
            verdicts = [
                tell_apart(
                    question.first, question.second, question.folds, kernel, rng=np.random.default_rng(seed)
                )
                for kernel in KERNELS
            ]
            rows.append(_row(question, size, verdicts))
            kept[question.text, size] = verdicts[-1]
            print("  ".join(rows[-1]), flush=True)
    return table(["told apart", "size", "linear SVM", "RBF SVM", "folds"], rows), kept


def scene_table(verdicts: Mapping[tuple[str, str], Verdict], asked: Mapping[str, Sequence[Question]]) -> str:
    """Return the accuracy of the RBF machine at each held-out place, by look, both sizes."""
    columns: dict[str, list[str]] = {}
    keys = [(asked[size][k].text, size) for size in SIZES for k in range(len(LOOKS))]
    for column, key in enumerate(keys):
        for name, share in zip(verdicts[key].names, verdicts[key].accuracy, strict=True):
            row = columns.setdefault(name.split(" / ")[0], ["–"] * len(keys))
            row[column] = f"{100 * share:.0f} %"
    head = ["place", *(f"{look}, {size}" for size in SIZES for look in LOOKS)]
    return table(head, [[name, *cells] for name, cells in columns.items()])


def statistics_table(asked: Mapping[str, Sequence[Question]]) -> str:
    """Return the statistics that part real and rendered most at half size, and what they come to."""
    several = [asked["half"][k] for k in range(len(LOOKS))]
    aucs = [feature_aucs(q.first, q.second, q.folds) for q in several]
    order = np.argsort(-np.abs(aucs[0].mean(axis=0) - 0.5))[:SHOWN_STATISTICS]
    rows = []
    for k in order:
        kinds = several[0].first, *(q.second for q in several)
        rows.append(
            [
                NAMES[k],
                *(f"{a[:, k].mean():.2f} ({a[:, k].min():.2f} to {a[:, k].max():.2f})" for a in aucs),
                *(_figure(float(np.mean([v[:, k].mean() for v in kind.values()]))) for kind in kinds),
            ]
        )
    return table(["statistic", *(f"AUC {look}" for look in LOOKS), "real", *LOOKS], rows)


def _figure(value: float) -> str:
    return f"{value:,.3g}" if abs(value) < 1000 else f"{value:,.0f}"


def range_table(measured: Measured) -> str:
    """Return least and greatest over pictures of the means over their patches, and which share of them lies
    within the real range.
    """
    kinds = "real", *LOOKS
    rows = []
    for size in SIZES:
        for name in RANGED:
            k = NAMES.index(name)
            means = {
                kind: np.array([p[:, k].mean() for s in measured.values[kind, size].values() for p in s])
                for kind in kinds
            }
            low, high = means["real"].min(), means["real"].max()
            cells = [_figure(float(low)) + " to " + _figure(float(high))]
            for look in LOOKS:
                found = means[look]
                inside = float(np.mean((found >= low) & (found <= high)))
                cells.append(
                    f"{_figure(float(found.min()))} to {_figure(float(found.max()))} ({100 * inside:.0f} %)"
                )
            rows.append([name, size, *cells])
    return table(["statistic", "size", "real", *(f"{look} (inside)" for look in LOOKS)], rows)


def write_sheets(tiles: Mapping[str, list[npt.NDArray[np.uint8]]], folder: Path) -> None:
    """Write the sheets of pictures, a row a frame: real, then each look."""
    from PIL import Image

    for sheet, missions in SHEETS.items():
        rows = [np.hstack(tiles[f.name]) for f in FRAMES if f.mission in missions and f.name in tiles]
        if not rows:
            continue
        if len(rows) > 5:  # two columns
            rows += [np.full_like(rows[0], 255)] * (len(rows) % 2)
            rows = [np.hstack(pair) for pair in zip(rows[::2], rows[1::2], strict=True)]
        Image.fromarray(np.vstack(rows)).save(folder / f"{sheet}.jpg", quality=80, optimize=True)


def main() -> int:
    """Print tables; with --out write tables and sheets into the docs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, help="of all terrains and draws")
    parser.add_argument("--per-frame", type=int, default=2, help="rendered partners of a Mars frame")
    parser.add_argument("--mars", action="store_true", help="leave out Devon Island and Apollo")
    parser.add_argument("--out", type=Path, help="docs folder that gets tables and sheets")
    arguments = parser.parse_args()
    if arguments.per_frame < 1:
        parser.error(f"--per-frame is {arguments.per_frame}; at least 1 is needed")
    seed = secrets.randbits(31) if arguments.seed is None else arguments.seed
    print(f"seed {seed}", flush=True)
    frames = [f for f in FRAMES if (IMAGERY / f.path).is_file() and (f.of_mars or not arguments.mars)]
    if len({f.scene for f in frames if f.of_mars}) < 2:
        print(
            f"at least two Mars scenes are needed in {IMAGERY}; {len(frames)} frames are there",
            file=sys.stderr,
        )
        return 2
    measured = measure_all(frames, arguments.per_frame, seed)
    asked = {size: questions(measured, size, frames) for size in SIZES}
    body, verdicts = verdict_table(asked, seed)
    scenes, statistics, ranges = scene_table(verdicts, asked), statistics_table(asked), range_table(measured)
    pictures = sum(
        len(p) for (kind, size), s in measured.values.items() if size == "full" for p in s.values()
    )
    body += (
        f"\nSeed {seed}: {pictures} pictures, at most {PATCHES} patches of {PATCH_PX} px each. In brackets "
        f"the 95 % interval by drawing folds with replacement.\n"
    )
    print(f"{body}\n{scenes}\n{statistics}\n{ranges}")
    if arguments.out is not None:
        sections = {"verdict": body, "scenes": scenes, "statistics": statistics, "ranges": ranges}
        for name, text in sections.items():
            write_section(arguments.out, "pictures", name, text)
        write_sheets(measured.tiles, arguments.out / "img")
    return 0


if __name__ == "__main__":
    sys.exit(main())
