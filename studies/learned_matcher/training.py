"""Training of the network on pairs of patches, and its file for OpenCV's dnn.

Loss: for each pair of a batch the distance of its two vectors, less that to the nearest vector of another
point, hinged at a margin of one (Mishchuk et al. 2017, eq. 3). Another point's patch that shows mostly the
same surface is no negative. PyTorch and onnx are those of `studies/learned_matcher.txt`, in a place of their
own; nothing else needs them.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.vision.learned.descriptor import FILE, LENGTH, PATCH_PX, Net, described
from studies.learned_matcher.kept_pairs import STORED, PatchPairs
from studies.learned_matcher.patches import Array, Grey

LAYERS = (
    (16, 5, 2, 2),
    (16, 3, 1, 1),
    (32, 3, 2, 1),
    (32, 3, 1, 1),
    (64, 3, 2, 1),
    (64, 3, 1, 1),
    (LENGTH, 4, 1, 0),
)
"""Channels, kernel, stride and padding of each convolution: 2.5 million products a patch, 137,000 weights."""
GROUPS, OF_GROUP = 4, 128
"""Pairs of pictures of a batch, and patches of each: rivals are mostly of the same picture, as in use."""
LEARNING_RATE, MARGIN = 4e-3, 1.0
OVERLAP = 0.4
"""Share of the larger radius within which two patches show mostly the same surface."""
EQUAL = 1e-4
"""What the two programs' unit vectors may differ."""
EVERY_S = 30.0


@dataclass(frozen=True, slots=True)
class Batch:
    """Numbers (n,) of pairs, and which (n, n) of them are one another's rivals."""

    numbers: npt.NDArray[np.int64]
    rivals: npt.NDArray[np.bool_]


def rivals_of(points: Array, radius_m: Array, world: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return which (n, n) of some points (n, 3), m, with patches of radii (n,), m, show other things.

    `world` (n,) says whose points they are.
    """
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = apart < OVERLAP * np.maximum(radius_m[:, None], radius_m[None])
    return np.asarray(~near | (world[:, None] != world[None]))


class Corpus:
    """All pairs of a folder."""

    def __init__(self, folder: Path) -> None:
        parts = [PatchPairs.load(path) for path in sorted(folder.glob("pairs_*.npz"))]
        if not parts:
            raise FileNotFoundError(f"{folder} holds no pairs; the command pairs makes them")
        self.one, self.other, self.points, self.radius_m = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("one", "other", "points", "radius_m")
        )
        self.world = np.repeat(np.arange(len(parts)), [len(part.one) for part in parts])
        self.groups: list[npt.NDArray[np.int64]] = []
        start = 0
        for part in parts:
            for number in np.unique(part.group):
                self.groups.append(start + np.flatnonzero(part.group == number))
            start += len(part.one)

    def batch(self, rng: np.random.Generator) -> Batch:
        """Return a batch drawn from some pairs of pictures."""
        chosen = rng.permutation(len(self.groups))[:GROUPS]
        numbers = np.concatenate([rng.permutation(self.groups[g])[:OF_GROUP] for g in chosen])
        where = self.points[numbers], self.radius_m[numbers], self.world[numbers]
        return Batch(numbers, rivals_of(*where))

    def views(self, batch: Batch, rng: np.random.Generator) -> tuple[Grey, Grey]:
        """Return both views (n, 32, 32) of a batch, altered as by sensors, normalised."""
        one, other = (
            altered((kept[batch.numbers].astype(np.float32) - 128.0) / STORED, rng)
            for kept in (self.one, self.other)
        )
        return (one, other) if rng.uniform() < 0.5 else (other, one)


def altered(patches: Grey, rng: np.random.Generator) -> Grey:
    """Return patches (n, 32, 32) with other contrast curves, noise, and half of them blurred."""
    import cv2

    count = len(patches)
    noise = rng.uniform(0, 0.25, (count, 1, 1)) * rng.normal(0, 1.0, patches.shape)
    bent = patches + rng.normal(0, 0.08, (count, 1, 1)) * patches * np.abs(patches) + noise
    out = bent.astype(np.float32)
    for n in np.flatnonzero(rng.uniform(size=count) < 0.5):
        out[n] = cv2.GaussianBlur(out[n], (0, 0), float(rng.uniform(0.3, 1.2)))
    out -= out.mean(axis=(1, 2), keepdims=True)
    return np.asarray(out / np.maximum(out.std(axis=(1, 2), keepdims=True), 1e-3), dtype=np.float32)


def network(torch: Any) -> Any:
    """Return the untrained network."""
    nn, layers, before = torch.nn, [], 1
    for number, (channels, kernel, stride, padding) in enumerate(LAYERS):
        last = number == len(LAYERS) - 1
        layers.append(nn.Conv2d(before, channels, kernel, stride, padding, bias=False))
        layers.append(nn.BatchNorm2d(channels, affine=not last))
        layers += [] if last else [nn.ReLU()]
        before = channels
    return nn.Sequential(*layers)


def loss_of(torch: Any, one: Any, other: Any, rivals: Any) -> Any:
    """Return the mean hinge of a batch: vectors (n, d) of both views, and which (n, n) are rivals."""
    distance = torch.sqrt(torch.clamp(2.0 - 2.0 * one @ other.T, min=1e-8))
    right = distance.diagonal()
    far = distance + 10.0 * (~rivals)
    hardest = torch.minimum(far.min(dim=0).values, far.min(dim=1).values)
    return torch.clamp(MARGIN + right - hardest, min=0.0).mean(), (right < hardest).float().mean()


def train(folder: Path, minutes: float, seed: int) -> None:
    """Train for some minutes of processor, going on from the folder's checkpoint, and write the network."""
    torch = import_module("torch")
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    corpus, model, kept = Corpus(folder), network(torch), folder / "checkpoint.pt"
    optimiser = torch.optim.Adam(model.parameters(), lr=LEARNING_RATE, weight_decay=1e-4)
    steps, spent = 0, 0.0
    if kept.is_file():
        state = torch.load(kept, weights_only=True)
        model.load_state_dict(state["model"])
        optimiser.load_state_dict(state["optimiser"])
        steps, spent = state["steps"], state["spent"]
    print(f"{len(corpus.one)} pairs of patches, seed {seed}, {spent:.0f} s behind", flush=True)
    started, told, budget = time.process_time() - spent, spent, 60.0 * minutes
    mean_loss = mean_right = 0.0
    model.train()
    while (spent := time.process_time() - started) < budget:
        # up for a tenth of the time, then down to nothing, by a cosine
        part = spent / budget
        rate = part / 0.1 if part < 0.1 else 0.5 * (1.0 + np.cos(np.pi * (part - 0.1) / 0.9))
        for group in optimiser.param_groups:
            group["lr"] = LEARNING_RATE * max(0.02, rate)
        rng = np.random.default_rng([seed, steps])
        batch = corpus.batch(rng)
        views = np.concatenate(corpus.views(batch, rng))[:, None]
        vectors = torch.nn.functional.normalize(model(torch.from_numpy(views)).flatten(1))
        count = len(batch.numbers)
        loss, right = loss_of(torch, vectors[:count], vectors[count:], torch.from_numpy(batch.rivals))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        steps += 1
        share = max(0.02, 1.0 / steps)
        mean_loss += share * (float(loss.detach()) - mean_loss)
        mean_right += share * (float(right) - mean_right)
        if spent - told > EVERY_S:
            told = spent
            state = {"model": model.state_dict(), "optimiser": optimiser.state_dict()}
            torch.save(state | {"steps": steps, "spent": spent}, kept)
            right_pct = 100 * mean_right
            print(
                f"{spent:4.0f} s, {steps} steps: loss {mean_loss:.3f}, nearest right {right_pct:.1f} %",
                flush=True,
            )
    model.eval()
    path = folder / FILE.name
    write_network(model, path)
    off = difference(torch, model, Net.read(path))
    size = path.stat().st_size
    print(f"{path}: {size} bytes, vectors of both programs differ by {off:.1e}")
    if off > EQUAL:
        raise ValueError(f"OpenCV's vectors differ by {off:.1e} from PyTorch's; {EQUAL:.0e} is the limit")


def folded(model: Any) -> list[tuple[Grey, Grey]]:
    """Return weights (out, in, k, k) and biases (out,) of each convolution with its normalisation in them."""
    layers = list(model)
    found = []
    for number, layer in enumerate(layers):
        if not hasattr(layer, "kernel_size"):
            continue
        norm = layers[number + 1]
        scale = 1.0 / np.sqrt(norm.running_var.numpy() + norm.eps)
        shift = np.zeros_like(scale)
        if norm.affine:
            scale, shift = scale * norm.weight.detach().numpy(), norm.bias.detach().numpy()
        weights = layer.weight.detach().numpy() * scale[:, None, None, None]
        found.append((weights, shift - norm.running_mean.numpy() * scale))
    return found


def write_network(model: Any, path: Path) -> None:
    """Write a trained network as ONNX: patches (n, 1, 32, 32) to vectors (n, d, 1, 1)."""
    onnx = import_module("onnx")
    helper, kept = onnx.helper, onnx.numpy_helper
    nodes, values, before = [], [], "patches"
    for number, ((weights, bias), (_, kernel, stride, padding)) in enumerate(
        zip(folded(model), LAYERS, strict=True)
    ):
        names = f"weights_{number}", f"bias_{number}"
        values += [
            kept.from_array(v.astype(np.float32), n) for v, n in zip((weights, bias), names, strict=True)
        ]
        last = number == len(LAYERS) - 1
        after = "vectors" if last else f"convolved_{number}"
        nodes.append(
            helper.make_node(
                "Conv",
                [before, *names],
                [after],
                kernel_shape=[kernel] * 2,
                strides=[stride] * 2,
                pads=[padding] * 4,
            )
        )
        before = after
        if not last:
            nodes.append(helper.make_node("Relu", [after], [f"positive_{number}"]))
            before = f"positive_{number}"
    kind = onnx.TensorProto.FLOAT
    given = helper.make_tensor_value_info("patches", kind, ["n", 1, PATCH_PX, PATCH_PX])
    told = helper.make_tensor_value_info("vectors", kind, ["n", LAYERS[-1][0], 1, 1])
    graph = helper.make_graph(nodes, "descriptor", [given], [told], values)
    model_file = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.checker.check_model(model_file)
    path.write_bytes(model_file.SerializeToString())


def difference(torch: Any, model: Any, net: Net) -> float:
    """Return by how much OpenCV's unit vectors of random patches differ from PyTorch's at most."""
    patches = np.random.default_rng(0).normal(0, 1.0, (300, PATCH_PX, PATCH_PX)).astype(np.float32)
    with torch.no_grad():
        own = torch.nn.functional.normalize(model(torch.from_numpy(patches[:, None])).flatten(1)).numpy()
    return float(np.abs(own - described(net, patches)).max())
