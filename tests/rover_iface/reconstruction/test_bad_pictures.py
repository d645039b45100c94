"""Pictures, labels and calibrations that are wrong: each has a named outcome, and none becomes ground."""

from __future__ import annotations

import json
import shutil
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from rover_iface.errors import PicturesError, RoverError
from rover_iface.frames import Transform
from rover_iface.reconstruction.fusion import fuse, grid_over
from rover_iface.reconstruction.outcomes import Reason, Refusal, RefusedError
from rover_iface.reconstruction.pair_surface import pair_surface
from rover_iface.reconstruction.picture_pairs import PicturePair, labelled_pairs, pair_of
from rover_iface.reconstruction.row_check import check_rows
from rover_iface.reconstruction.site_model import reconstruct
from tests.rover_iface.reconstruction.products import (
    DEVON_RIG,
    SITE,
    devon_folder,
    rendered,
    rendered_folder,
    write_product,
)
from tests.shared import shared


def first_pair() -> PicturePair:
    pose, cameras, samples = rendered()[0]
    there = pose.site_from_rover
    moved = cameras[0].transformed(there), cameras[1].transformed(there)
    return pair_of("first", samples, moved, there)


def reason_of(pair: PicturePair) -> Reason:
    with pytest.raises(RefusedError) as caught:
        check_rows(pair)
    return caught.value.refusal.reason


@pytest.mark.parametrize("off_px", [5.0, -5.0, 12.0])
def test_a_rig_that_is_off_by_five_pixels_across_the_rows_is_refused_with_the_figure(off_px: float) -> None:
    pair = first_pair()
    camera = pair.right_camera
    wrong = replace(camera, V=camera.V + off_px * camera.A)
    with pytest.raises(RefusedError) as caught:
        check_rows(replace(pair, right_camera=wrong))
    refusal = caught.value.refusal
    assert refusal.reason is Reason.ROWS_APART
    told = float(refusal.text.split("differ by ")[1].split(" px")[0])
    assert told == pytest.approx(abs(off_px), abs=0.3)


def test_a_rig_that_is_off_by_two_pixels_is_turned_and_trusted_less() -> None:
    pair = first_pair()
    camera = pair.right_camera
    check = check_rows(replace(pair, right_camera=replace(camera, V=camera.V + 2.0 * camera.A)))
    assert check.apart_px == pytest.approx(2.0, abs=0.2)
    assert check.after_px < 0.3
    good, worse = (pair_surface(pair, c) for c in (check_rows(pair), check))
    where = good.points[np.isfinite(good.disparities)][::999]
    flat = np.zeros((len(where), 2))
    assert (worse.height_variance(where, flat) > 4.0 * good.height_variance(where, flat)).all()


def test_left_and_right_swapped_are_told() -> None:
    pair = first_pair()
    assert reason_of(replace(pair, left=pair.right, right=pair.left)) is Reason.SIDES_SWAPPED
    other = replace(pair, left_camera=pair.right_camera, right_camera=pair.left_camera)
    assert reason_of(other) is Reason.SIDES_SWAPPED


def test_pictures_of_different_places_are_no_pair() -> None:
    one, (_, _, samples) = first_pair(), rendered()[1]
    # the right picture is upside down: nothing of it belongs to the left one
    wrong = replace(one, right=np.ascontiguousarray(np.asarray(samples[1])[::-1] / 4095.0))
    assert reason_of(wrong) in {Reason.FEW_MATCHES, Reason.ROWS_APART, Reason.SIDES_SWAPPED}


def test_noise_is_no_pair() -> None:
    pair = first_pair()
    noise = np.random.default_rng(5).uniform(0.1, 1.0, pair.right.shape)
    assert reason_of(replace(pair, right=noise)) is Reason.FEW_MATCHES


def test_half_a_picture_lost_gives_ground_in_the_other_half_only(tmp_path: Path) -> None:
    folder = rendered_folder(tmp_path, pairs=1)
    pose, cameras, samples = rendered()[0]
    half = samples[0].copy()
    half[:, 256:] = 0.0
    write_product(folder / "2n0left.img", half, cameras[0], SITE * pose.site_from_rover)
    made = reconstruct(folder)
    whole = reconstruct(rendered_folder(tmp_path / "whole", pairs=1))
    surface = made.surfaces[0]
    assert surface.pair.lost[0] == pytest.approx(0.5, abs=0.01)
    seen = surface.pair.left_camera.project(surface.points[np.isfinite(surface.disparities)])
    # windows that reach into what is lost compare nothing
    assert float(seen[:, 0].max()) < 256.0 - 8.0
    # and what is there agrees with the whole picture's ground
    layer, other = made.terrain.layers[0], whole.terrain.layers[0]
    rows, columns = np.nonzero(np.isfinite(layer.heights))
    x, y = layer.west + columns * layer.spacing, layer.south + rows * layer.spacing
    off = other.sample(x, y) - layer.heights[rows, columns]
    assert float(np.nanpercentile(np.abs(off), 95)) < 0.05


def test_a_picture_that_hardly_arrived_is_refused(tmp_path: Path) -> None:
    pose, cameras, samples = rendered()[0]
    gone = np.zeros_like(samples[0])
    gone[:20] = samples[0][:20]
    there = pose.site_from_rover
    with pytest.raises(RefusedError) as caught:
        pair_of("gone", (gone, samples[1]), cameras, there)
    assert caught.value.refusal.reason is Reason.PICTURE_LOST
    with pytest.raises(RefusedError) as caught:
        pair_of("flat", (np.full((32, 32), 7.0), np.full((32, 32), 7.0)), cameras, there)
    assert caught.value.refusal.reason is Reason.PICTURE_LOST


def outcomes(folder: Path) -> dict[str, Reason]:
    refused: list[Refusal] = []
    labelled_pairs(folder, refused)
    return {r.subject: r.reason for r in refused}


def relabelled(*, half_size: bool = False, **changes: Any) -> Callable[[Path], None]:
    """Return what writes the right eye of the first pair with a label that is wrong."""

    def write(folder: Path) -> None:
        pose, cameras, samples = rendered()[0]
        picture = samples[1]
        camera = cameras[1]
        if half_size:
            picture, camera = picture[::2, ::2], camera.scaled(0.5)
        path = folder / "2n0right.img"
        write_product(path, picture, camera, SITE * pose.site_from_rover, eye="RIGHT", **changes)

    return write


@pytest.mark.parametrize(
    ("change", "subject", "reason"),
    [
        (relabelled(seconds=500.0), "2N0LEFT", Reason.NO_PARTNER),
        (relabelled(counter=(137, 40)), "2N0RIGHT", Reason.NO_PARTNER),
        (relabelled(counter=(138, 0)), "2N0RIGHT", Reason.OTHER_SITE),
        (relabelled(half_size=True), "2N0LEFT", Reason.SIZE_DIFFERS),
        (relabelled(beside_deg=9.0), "2n0right.img", Reason.LABEL_CONTRADICTION),
        (relabelled(lines=900), "2n0right.img", Reason.UNREADABLE),
    ],
)
def test_a_label_that_does_not_fit_is_named(
    tmp_path: Path, change: Callable[[Path], None], subject: str, reason: Reason
) -> None:
    folder = rendered_folder(tmp_path)
    change(folder)
    found = outcomes(folder)
    assert found[subject] is reason
    # the other pair is used all the same
    assert len(reconstruct(folder).surfaces) >= 1


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (b"ORIGIN_ROTATION_QUATERNION = (", b"ORIGIN_ROTATION_QUATERNION = (9", Reason.LABEL_CONTRADICTION),
        (b"ORIGIN_OFFSET_VECTOR = (", b"ORIGIN_OFFSET_VECTOR = (x,", Reason.NO_POSE),
        (b"GROUP = ROVER_COORDINATE_SYSTEM", b"GROUP = NOWHERE_COORDINATE_SYST", Reason.NO_POSE),
        (
            b"REFERENCE_COORD_SYSTEM_NAME = ROVER_FRAME",
            b"REFERENCE_COORD_SYSTEM_NAME = EARTH_FRAME",
            Reason.NO_POSE,
        ),
        (b'INSTRUMENT_ID = "NAVCAM_LEFT"', b'INSTRUMENT_ID = "NAVCAM_RITE"', None),
        (b'FRAME_ID = "LEFT"', b'FRAME_ID = "RIGHT"', Reason.LABEL_CONTRADICTION),
        (b"MODEL_TYPE = CAHVOR", b"MODEL_TYPE = CAVHOR", Reason.UNREADABLE),
        (b"SAMPLE_BITS = 16", b"SAMPLE_BITS = xx", Reason.UNREADABLE),
        (b"ROVER_MOTION_COUNTER = (137", b"ROVER_MOTION_COUNTER = (abc", Reason.NO_POSE),
        (b"END_GROUP", b"END_GRUOP", Reason.UNREADABLE),
    ],
)
def test_a_damaged_label_is_named_and_raises_nothing(
    tmp_path: Path, old: bytes, new: bytes, reason: Reason | None
) -> None:
    folder = rendered_folder(tmp_path, pairs=1)
    path = folder / "2n0left.img"
    raw = path.read_bytes()
    head, picture = raw[: 7 * 1024], raw[7 * 1024 :]
    assert old in head
    changed = head.replace(old, new, 1)
    path.write_bytes(changed.rstrip(b" ")[: 7 * 1024].ljust(7 * 1024, b" ") + picture)
    found = outcomes(folder)
    if reason is not None:
        assert found["2n0left.img"] is reason


@given(where=st.integers(0, 3400), junk=st.binary(min_size=1, max_size=12))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_stands_in_a_label_ends_in_an_outcome(tmp_path: Path, where: int, junk: bytes) -> None:
    folder = tmp_path / "in"
    if not folder.is_dir():
        rendered_folder(folder, pairs=1)
        (tmp_path / "whole").write_bytes((folder / "2n0left.img").read_bytes())
    raw = (tmp_path / "whole").read_bytes()
    (folder / "2n0left.img").write_bytes(raw[:where] + junk + raw[where + len(junk) :])
    refused: list[Refusal] = []
    pairs = labelled_pairs(folder, refused)
    assert len(pairs) + len(refused) >= 1


@pytest.mark.parametrize(
    "change",
    [
        {"dimension": "(640,480)"},
        {"dimension": "wide"},
        {"camera_model_component_list": "(1,2);(3)"},
        {"camera_model_component_list": 5},
        {"camera_model_type": None},
        {},
    ],
)
def test_mars_2020_metadata_ends_in_an_outcome(tmp_path: Path, change: dict[str, object]) -> None:
    source = shared("data/imagery/m2020")
    (label,) = source.glob("*.json")
    (picture,) = source.glob("*.png")
    document = json.loads(label.read_text())
    (tmp_path / label.name).write_text(json.dumps({**document, **change}))
    shutil.copyfile(picture, tmp_path / picture.name)
    (reason,) = outcomes(tmp_path).values()
    # a raw feed tells where the rover stood and not how it was turned
    assert reason is (Reason.UNREADABLE if change else Reason.NO_POSE)


def test_flight_frames_of_one_eye_alone_are_no_terrain(tmp_path: Path) -> None:
    for path in shared("data/imagery/mer").glob("2n2922809*"):
        shutil.copyfile(path, tmp_path / path.name)
    with pytest.raises(PicturesError, match="no right picture of NAVCAM in the folder"):
        reconstruct(tmp_path)
    # three products of one exposure count once, and labels of an archive contradict nothing
    assert set(outcomes(tmp_path).values()) == {Reason.NO_PARTNER}
    assert len(outcomes(tmp_path)) == 2


def test_an_empty_folder_and_none_are_told(tmp_path: Path) -> None:
    with pytest.raises(PicturesError, match="holds no pictures"):
        reconstruct(tmp_path)
    with pytest.raises(PicturesError, match="is not a folder"):
        reconstruct(tmp_path / "none")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("image-pairs/1", "image-pairs/7", "format"),
        ("baseline_m = 0.239977002", "baseline_m = -1.0", "baseline_m"),
        ("baseline_m = 0.239977002", "baseline_m = nan", "baseline_m"),
        ("focal_px = 968.999694824", "", "focal_px"),
        ("[rig.pinhole]", "rig = 5\n[none]", "rig"),
        ('left = "devon1-left.png"', 'left = "../secret.png"', "outside the folder"),
        ('left = "devon1-left.png"', 'left = "none.png"', "no such file"),
        ("width = 1280", "width = 640", "has \\(1280, 960\\) pixels, the camera \\(640, 960\\)"),
        ("heading_deg = 90.0", 'heading_deg = "east"', "heading_deg"),
        ("baseline_m = 0.239977002", "baseline_m = 0.239977002\n[rig.left]", "rig"),
    ],
)
def test_a_description_that_is_wrong_says_where(tmp_path: Path, old: str, new: str, told: str) -> None:
    picture = np.zeros((960, 1280), np.uint8)
    for side in ("left", "right"):
        Image.fromarray(picture).save(tmp_path / f"devon1-{side}.png")
    text = (
        f'format = "image-pairs/1"\n{DEVON_RIG}\n[[pairs]]\nleft = "devon1-left.png"\n'
        'right = "devon1-right.png"\n'
        "position_m = [0.0, 0.0, 1.5]\nheading_deg = 90.0\n"
    )
    assert old in text
    (tmp_path / "pairs.toml").write_text(text.replace(old, new))
    with pytest.raises(RoverError, match=told):
        reconstruct(tmp_path)


def test_a_real_calibration_that_is_five_pixels_off_is_refused(tmp_path: Path) -> None:
    folder = devon_folder(shared("data/imagery"), tmp_path, 1)
    right = np.asarray(Image.open(folder / "devon1-right.png"))
    Image.fromarray(np.roll(right, 5, axis=0)).save(folder / "devon1-right.png")
    with pytest.raises(PicturesError, match=r"rows-apart: the rows of \d+ points .* differ by [45]\.\d px"):
        reconstruct(folder)


def test_a_pair_that_contradicts_the_others_is_left_out() -> None:
    one, two = first_pair(), first_pair()
    up = Transform(np.eye(3), np.array([0.0, 0.0, 0.8]))
    two = replace(
        two,
        name="raised",
        left_camera=two.left_camera.transformed(up),
        right_camera=two.right_camera.transformed(up),
    )
    surfaces = [pair_surface(p, check_rows(p)) for p in (one, two)]
    refused: list[Refusal] = []
    fused = fuse(surfaces, grid_over(surfaces, 0.05), 0.15, refused)
    assert [r.reason for r in refused] == [Reason.SURFACES_APART]
    assert [s.pair.name for s in fused.used] == ["first"]


def test_nested_metadata_and_a_picture_of_a_billion_pixels_end_in_an_outcome(tmp_path: Path) -> None:
    (tmp_path / "deep.json").write_text('{"a":' * 20_000 + "1" + "}" * 20_000)
    source = next(iter(shared("data/imagery/m2020").glob("*.json")))
    document = {**json.loads(source.read_text()), "dimension": "(40000,40000)"}
    (tmp_path / "wide.json").write_text(json.dumps(document))
    raw = b"\x89PNG\r\n\x1a\n"
    body = b"IHDR" + (40_000).to_bytes(4, "big") * 2 + b"\x08\x00\x00\x00\x00"
    raw += (13).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")
    (tmp_path / "wide.png").write_bytes(raw)
    assert set(outcomes(tmp_path).values()) == {Reason.UNREADABLE}
    assert len(outcomes(tmp_path)) == 2


def test_two_cameras_in_one_place_are_no_pair() -> None:
    pair = first_pair()
    assert reason_of(replace(pair, right_camera=pair.left_camera)) is Reason.LABEL_CONTRADICTION
