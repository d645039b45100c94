"""Label readers on the missions' own files, and on damaged ones."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from rover_iface.cameras.labels import parse_vicar, read_product
from rover_iface.cameras.linear import warp
from rover_iface.cameras.model import ModelKind
from rover_iface.errors import CameraLabelError
from tests.shared import shared

MER = "data/imagery/mer/"
CASES = [
    (MER + "2n292280938effb100p0703l0m1.img.gz", ModelKind.CAHVOR, (1024, 1024)),
    (MER + "2n292280938rslb100p0703l0m1.img.gz", ModelKind.CAHV, (1024, 1024)),
    (MER + "1f581291004ednd2fcp1121r0m1.img.gz", ModelKind.CAHVORE, (512, 512)),
    ("data/imagery/msl/NRB_701384494RAD_F0933408NCAM00200M1.LBL", ModelKind.CAHVOR, (1024, 1024)),
    ("data/imagery/msl/NRB_701384494RAD_F0933408NCAM00200M1.IMG.gz", ModelKind.CAHVOR, (1024, 1024)),
    ("data/imagery/msl/RLB_701384675RAS_F0933408RHAZ00337M1.LBL", ModelKind.CAHVORE, None),
    (
        "data/imagery/m2020/NLF_0670_0726421423_362ECM_N0320604NCAM08111_01_095J01-metadata.json",
        ModelKind.CAHVORE,
        (968, 1288, 3),
    ),
]


@pytest.mark.parametrize(("path", "kind", "shape"), CASES)
def test_labels_of_three_missions_give_camera_and_image(
    path: str, kind: ModelKind, shape: tuple[int, ...] | None
) -> None:
    product = read_product(shared(path))
    assert product.camera.kind is kind
    assert (product.image is None) if shape is None else (product.image is not None)
    if product.image is not None:
        assert product.image.shape == shape
        assert product.image.std() > 5
        assert product.camera.size == (shape[1], shape[0]) if shape else True


def test_labels_give_the_models_of_the_reference_file() -> None:
    cameras = json.loads(shared("data/imagery/camera_models/cahvor_vectors.json").read_text())["cameras"]
    pairs = {
        "mer2_navcam_left_sol1869_a": CASES[0][0],
        "mer1_front_hazcam_right_half": CASES[2][0],
        "msl_navcam_right_b_sol3422": CASES[3][0],
        "msl_rear_hazcam_left_b_sol3422": CASES[5][0],
        "m2020_navcam_left_sol0670_tile": CASES[6][0],
    }
    for name, path in pairs.items():
        camera, expected = read_product(shared(path)).camera, cameras[name]
        for vector in expected["vectors"]:
            assert np.abs(camera.project(vector["points"]) - vector["pixel"]).max() < 1e-4, name


def test_the_vicar_label_inside_a_pds_file_tells_the_same(tmp_path: Path) -> None:
    source = shared(CASES[0][0])
    data = gzip.decompress(source.read_bytes())
    vicar = tmp_path / "frame.vic"
    vicar.write_bytes(data[data.index(b"LBLSIZE=") :])
    pds, read = read_product(source), read_product(vicar)
    assert read.camera == pds.camera
    assert read.instrument == pds.instrument == "NAVCAM_LEFT"
    assert read.image is not None
    assert pds.image is not None
    assert np.array_equal(read.image, pds.image)


def test_linearising_a_spirit_frame_agrees_with_the_missions_own_product() -> None:
    import cv2

    raw = read_product(shared(MER + "2n292280938radb100p0703l0c1.img.gz"))
    published = read_product(shared(MER + "2n292280938rslb100p0703l0m1.img.gz"))
    assert raw.image is not None
    assert published.image is not None
    ours = warp(raw.image, raw.camera, published.camera).astype(float)
    theirs = published.image.astype(float)
    window = cv2.createHanningWindow((64, 64), cv2.CV_64F)
    shifts, scores = [], []
    for top in range(0, 1024 - 63, 96):
        for left in range(0, 1024 - 63, 96):
            a, b = (image[top : top + 64, left : left + 64] for image in (ours, theirs))
            if (a <= 0).any() or (b <= 0).any():
                continue
            scores.append(np.corrcoef(a.ravel(), b.ravel())[0, 1])
            shifts.append(cv2.phaseCorrelate(a.copy(), b.copy(), window)[0])  # works in place
    assert len(shifts) > 60
    assert np.abs(np.median(shifts, axis=0)).max() <= 0.01
    assert np.median(scores) >= 0.9999


def test_a_label_without_a_camera_model_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "bare.lbl"
    path.write_text("PDS_VERSION_ID = PDS3\r\nLINES = 4\r\nLINE_SAMPLES = 4\r\nEND\r\n")
    with pytest.raises(CameraLabelError, match=r"bare\.lbl holds no camera model"):
        read_product(path)
    path = tmp_path / "raw.json"
    path.write_text(json.dumps({"imageid": "X", "camera_model_type": "UNK"}))
    with pytest.raises(CameraLabelError, match=r"raw\.json holds no camera model"):
        read_product(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"GIF89a......", "neither a PDS3, a VICAR nor a JSON label"),
        (b"{ not json", "not a JSON document"),
        (b"PDS_VERSION_ID = PDS3\r\nGROUP = A\r\n B = (1, 2\r\n", "not closed|no statement"),
        (b"PDS_VERSION_ID = PDS3\r\nEND_GROUP = A\r\nEND\r\n", "a group ends that did not start"),
        (b"\x1f\x8b\x08\x00broken", "damaged gzip"),
    ],
)
def test_damaged_labels_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "x.img"
    path.write_bytes(content)
    with pytest.raises(CameraLabelError, match=message):
        read_product(path)


def test_an_image_shorter_than_its_label_is_refused(tmp_path: Path) -> None:
    data = gzip.decompress(shared(CASES[0][0]).read_bytes())
    path = tmp_path / "short.img"
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(CameraLabelError, match="label promises"):
        read_product(path)


def test_vicar_values_keep_their_types() -> None:
    label = parse_vicar(b"LBLSIZE=120  NL=4 PROPERTY='P' A='it''s' B=(1,2.5,'x') C=-3.5E-2   TASK='T' NL=9")
    assert label["NL"] == 4
    assert label["P"] == {"A": "it's", "B": [1, 2.5, "x"], "C": -0.035}


def test_a_damaged_number_of_a_mars_2020_label_is_named(tmp_path: Path) -> None:
    document = {
        "camera_model_component_list": "(1.0,2.0,x);(1.0,0.0,0.0)",
        "camera_model_type": "CAHV",
        "dimension": "(100,100)",
    }
    file = tmp_path / "NLF-metadata.json"
    file.write_text(json.dumps(document))
    with pytest.raises(CameraLabelError, match="camera_model_component_list"):
        read_product(file)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"camera_model_component_list": "T"}, "lacks vector"),
        ({"dimension": "(0,968)"}, "0 x 968"),
        ({"dimension": "(12880000,968)"}, "12880000 x 968"),
        ({"camera_model_type": "FISHEYE"}, "FISHEYE"),
    ],
)
def test_damaged_metadata_of_mars_2020_say_what_is_wrong(
    tmp_path: Path, change: dict[str, str], told: str
) -> None:
    label = json.loads(shared(CASES[6][0]).read_text()) | change
    path = tmp_path / "damaged-metadata.json"
    path.write_text(json.dumps(label))
    with pytest.raises(CameraLabelError, match=told):
        read_product(path)


@pytest.mark.parametrize("at", range(8))
@pytest.mark.parametrize("damage", ["(1,2)", "x", "nan", "(1,2,x)", "", "(1e999,0,0)"])
def test_no_damaged_vector_escapes_as_another_error(tmp_path: Path, at: int, damage: str) -> None:
    label = json.loads(shared(CASES[6][0]).read_text())
    fields = label["camera_model_component_list"].split(";")
    fields[at] = damage
    path = tmp_path / "damaged-metadata.json"
    path.write_text(json.dumps(label | {"camera_model_component_list": ";".join(fields)}))
    with pytest.raises(CameraLabelError, match="damaged"):
        read_product(path)


def test_metadata_that_are_no_object_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "list-metadata.json"
    path.write_text("[1, 2]")
    with pytest.raises(CameraLabelError, match="list"):
        read_product(path)
