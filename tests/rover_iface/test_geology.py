"""Geologies: shapes of rock families, plates that fit, sand against rocks, files, what they leave alone."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_iface.cameras.model import pinhole
from rover_iface.errors import RenderError, TerrainFormatError
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.look import Look
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.simulator.render.texture import ripple
from rover_iface.terrain import GEOLOGIES, Geology, Rock, Terrain, generate_terrain, geology_named
from rover_iface.terrain.banks import STEEPEST, bank_depth
from rover_iface.terrain.geology import HEIGHTS, AlbedoFamily
from rover_iface.terrain.load import load_terrain, write_terrain
from rover_iface.terrain.rock_shapes import SHARP, Body, Family, radii
from rover_iface.terrain.rocks import icosphere, raise_rocks, rock_meshes
from rover_iface.terrain.strew import strew_rocks
from tests.rover_iface.worlds import plane

SHAPED: tuple[Family, ...] = ("slab", "plate", "block", "layered", "ventifact", "rounded")


@lru_cache(maxsize=4)
def site(name: str = "meridiani") -> Terrain:
    """A small site of a geology, quick to make."""
    return generate_terrain(5, 24.0, inner_m=12.0, rock_cover=0.1, geology=GEOLOGIES[name], ortho=False)


# ---- shapes


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(SHAPED),
    st.integers(0, 2**31 - 1),
    st.floats(0.1, 1.5),
    st.floats(0.05, 0.7),
    st.floats(0.1, 0.6),
)
def test_a_rock_of_any_family_is_closed_faces_out_and_has_its_size(
    family: Family, seed: int, diameter: float, height: float, burial: float
) -> None:
    rock = Rock("R", 1.0, -2.0, 0.5, diameter, height, 0.7, 0.8, burial, seed, family)
    (mesh,) = rock_meshes([rock])
    v, t = mesh.vertices.astype(float), mesh.triangles
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]))
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    a, b, c = (v[t[:, k]] for k in range(3))
    volume = np.einsum("ni,ni->n", a - v.mean(axis=0), np.cross(b - a, c - a))
    assert volume.sum() > 0
    wide = np.hypot(v[:, 0] - rock.x, v[:, 1] - rock.y).max()
    assert 0.75 * diameter / 2 < wide <= diameter / 2 + 1e-3  # 0.8 of it across
    assert v[:, 2].max() == pytest.approx(rock.z + height, abs=1e-3)
    assert v[:, 2].min() == pytest.approx(rock.z + height - height / (1 - burial), abs=1e-3)


@pytest.mark.parametrize("family", SHAPED)
def test_the_surface_of_a_shape_stays_away_from_its_middle(family: Family) -> None:
    directions = icosphere(3)[0]
    for seed in range(40):
        reach = radii(family, Body(seed, 0.2, 0.2), directions)
        assert 0.05 < reach.min() <= reach.max() < 3.0


def test_rocks_of_a_seed_are_alike_and_differ_by_seed_and_family() -> None:
    directions = icosphere(2)[0]
    shapes = [radii(f, Body(s, 0.2, 0.2), directions) for f in SHAPED for s in (1, 2)]
    assert np.array_equal(shapes[0], radii("slab", Body(1, 0.2, 0.2), directions))
    for k, one in enumerate(shapes):
        for other in shapes[:k]:
            assert not np.allclose(one, other)


def test_a_bedded_rock_has_steps_in_its_flank() -> None:
    # of a horizontal direction outwards, a smooth convex flank turns one way only
    def turns(family: Family) -> float:
        found = []
        for seed in range(20):
            up = np.linspace(-0.35, 0.35, 400)
            directions = np.column_stack((np.sqrt(1 - up**2), np.zeros(400), up))
            reach = radii(family, Body(seed, 0.4, 0.3), directions)
            found.append(np.abs(np.diff(reach)).max())
        return float(np.median(found))

    assert turns("layered") > 4 * turns("rounded")


def test_faces_of_a_ventifact_look_into_the_wind() -> None:
    directions = icosphere(4)[0]
    level = np.abs(directions[:, 2]) < 0.3
    toward, behind = [], []
    for seed in range(30):
        reach = radii("ventifact", Body(seed, 0.3, 0.3), directions)
        toward.append(reach[level & (directions[:, 0] > 0.8)].mean())
        behind.append(reach[level & (directions[:, 0] < -0.8)].mean())
    assert np.mean(toward) < np.mean(behind)


# ---- sites


def test_plates_fill_the_pavement_and_leave_joints_between_them() -> None:
    plates = [r for r in site().rocks if r.family == "plate"]
    assert len(plates) > 50
    shared = 0
    for rock in plates:
        far = [r for r in plates if r is not rock and math.hypot(r.x - rock.x, r.y - rock.y) < 1.5]
        for other in far:
            away = math.hypot(other.x - rock.x, other.y - rock.y)
            azimuth = math.atan2(other.y - rock.y, other.x - rock.x)
            joint = [d for a, d in rock.sides if abs(math.remainder(a - azimuth, math.tau)) < 1e-3]
            back = [d for a, d in other.sides if abs(math.remainder(a - azimuth - math.pi, math.tau)) < 1e-3]
            if joint and back:  # of neighbours, some centimetres remain; of others, a plate lies between
                gap = away - joint[0] - back[0]
                assert gap > 0.01
                shared += gap < 0.06
    assert shared > 2 * len(plates)


def test_plates_are_bodies_in_the_heights_and_under_the_rays() -> None:
    ground = site()
    scene = scene_from_terrain(ground, radius_m=5.0, far_m=5.0, stones_per_m2=0.0)
    seen = 0
    plates = [r for r in ground.rocks if r.family == "plate"]
    thickest = max(r.height for r in plates)
    for rock in [r for r in plates if max(abs(r.x), abs(r.y)) < 4][:30]:
        top = float(ground.height(rock.x, rock.y))
        assert top - float(ground.height(rock.x, rock.y, ground=True)) > -1e-6
        eye = np.array([[rock.x, rock.y, top + 1.0]])
        fall = float(scene.ranges(eye, np.array([[0.0, 0.0, -1.0]]))[0]) - 1.0
        hit = scene.cast(eye, np.array([[0.0, 0.0, -1.0]]))
        if scene.ids[scene.objects[hit["primID"][0]]] == rock.id:
            assert abs(fall) < 0.005
            seen += 1
        else:  # beside an edge heights lie on a line to the post that the plate has raised
            assert -0.005 < fall < thickest
    assert seen > 10


def test_sand_lies_deepest_beside_its_rock_and_runs_out_in_the_lee() -> None:
    rock = Rock("R", 0.0, 0.0, 0.0, 0.5, 0.25, elongation=1.0, seed=0, family="block")
    axis = np.arange(-2.0, 2.0, 0.02)
    depth = bank_depth(axis, axis, [rock], 1.0, wind_rad=0.0)  # from the east
    east, west = depth[100, 100:], depth[100, :101][::-1]
    assert 0.05 < depth.max() < rock.height
    assert west[np.searchsorted(axis[100:], 0.6)] > 0.02 > east[np.searchsorted(axis[100:], 0.6)]
    outside = np.hypot(*np.meshgrid(axis, axis)) > 0.30
    steep = np.hypot(*np.gradient(depth, 0.02))
    assert np.quantile(steep[outside & (depth > 0)], 0.99) < 1.5 * STEEPEST
    assert not bank_depth(axis, axis, [rock], 0.0, wind_rad=0.0).any()


def test_banked_sand_is_ground_of_the_site() -> None:
    bare = replace(GEOLOGIES["gusev"], surface=replace(GEOLOGIES["gusev"].surface, banks=0.0))
    without, banked = (
        generate_terrain(5, 24.0, inner_m=12.0, rock_cover=0.1, ortho=False, outcrop=False, geology=kind)
        for kind in (bare, GEOLOGIES["gusev"])
    )
    one, two = (t.layers[0].ground for t in (without, banked))
    assert one is not None
    assert two is not None
    assert (two - one).min() > -2e-3
    assert (two - one).max() > 0.03
    assert without.rocks == banked.rocks


@pytest.mark.parametrize("name", GEOLOGIES)
def test_a_geology_has_its_families_and_colours(name: str) -> None:
    kind = GEOLOGIES[name]
    rocks = [r for r in site(name).rocks if r.family != "plate"]
    found = {r.family for r in rocks}
    assert found <= set(kind.families)
    assert len(found) >= 2
    for rock in rocks:
        low, high = HEIGHTS[rock.family]
        assert low - 1e-3 <= rock.height / rock.diameter <= high + 1e-3
        assert any(abs(rock.albedo - s.mean) <= 5 * s.spread for s in kind.stones)
    near = [min(abs(r.albedo - s.mean) for s in kind.stones) for r in rocks]
    assert np.median(near) < 0.04


def test_a_plain_of_sand_buries_the_share_of_its_rocks_and_moves_none() -> None:
    many, few = ({(r.x, r.y) for r in site(n).rocks if r.family != "plate"} for n in ("gusev", "jezero"))
    assert few < many
    spread = math.sqrt(len(many) * 0.2 * 0.8)
    assert abs(len(few) - 0.2 * len(many)) < 4 * spread


def test_a_geology_survives_its_files(tmp_path: Path) -> None:
    ground = site()
    write_terrain(ground, tmp_path)
    again = load_terrain(tmp_path)
    assert again.rocks == ground.rocks
    assert again.surface == ground.surface
    assert ground.surface is not None
    assert ground.surface.geology == "meridiani"


def test_other_rocks_are_written_as_before(tmp_path: Path) -> None:
    ground = generate_terrain(5, 24.0, inner_m=12.0, ortho=False)
    write_terrain(ground, tmp_path)
    listing = json.loads((tmp_path / "rocks.json").read_text())
    names = ["id", "x", "y", "z", "diameter", "height", "yaw", "elongation", "burial", "seed"]
    assert all(list(rock) == names for rock in listing["rocks"])
    assert ground.surface is None


def test_a_real_ground_takes_the_rocks_of_a_geology() -> None:
    mine = replace(GEOLOGIES["gale"], name="mine")
    strewn = strew_rocks(plane(), seed=3, half_m=6.0, total_cover=0.1, geology=mine)
    assert {r.family for r in strewn.rocks} <= set(GEOLOGIES["gale"].families)
    assert strewn.surface is not None
    assert strewn.surface.banks == 0.0
    assert strewn.surface.geology == "mine"
    assert strew_rocks(plane(), seed=3, half_m=6.0, total_cover=0.1).surface is None


# ---- pictures


def test_the_default_site_and_its_picture_are_what_they_were() -> None:
    """Figures of the results pages rest on them; see there before you change these numbers."""
    ground = generate_terrain(11, 24.0, inner_m=12.0, rock_cover=0.12)
    assert ground.sha256 == "534419c8df5f4b904b2086233ad01e4eeefb9a073813b25c392df3ffa5f8af50"
    scene = scene_from_terrain(ground, radius_m=6.0, far_m=12.0, seed=4)
    camera = pinhole(focal_px=160, width=160, height=120, center=(0, 0, 1.4), forward=(1, 0.2, -0.35))
    sun = Sun.from_angles(math.radians(240), math.radians(40))
    image = Renderer(scene).render(camera, None, sun, seed=2).image
    told = hashlib.sha256(image.tobytes()).hexdigest()
    assert told == "a79e0b26050b73c1800ef8237bf74b87af5458e29453520a4ac5c590738a7238"


def test_edges_stay_sharp_above_the_crease_and_round_below_it() -> None:
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    sides = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    sides += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]

    def normals(crease_rad: float) -> np.ndarray:
        body = SceneMesh(box, np.array(sides), "BOX", Material.ROCK, crease_rad=crease_rad)
        return np.asarray(np.abs(Scene([body]).normals).max(axis=1))

    assert np.allclose(normals(math.radians(35)), 1.0)
    assert normals(math.radians(100)).max() < 0.9


def test_a_scene_of_a_geology_brings_its_look_and_another_may_be_given() -> None:
    scene = scene_from_terrain(site(), radius_m=3.0, far_m=3.0, stones_per_m2=1.0)
    assert Renderer(scene).look.ripples == GEOLOGIES["meridiani"].surface.ripples
    assert Renderer(scene, look=Look()).look == Look()
    assert scene_from_terrain(plane(), radius_m=4.0, far_m=8.0).look is None


def test_ripples_lie_across_the_wind_and_fade_with_the_pixel() -> None:
    places = np.random.default_rng(4).uniform(-20, 20, (3000, 2))
    slopes = np.array([ripple(x, y, 0.005, 1.0, 0.0, 3)[1:] for x, y in places])
    assert np.abs(slopes[:, 0]).mean() > 3 * np.abs(slopes[:, 1]).mean()
    assert not any(ripple(x, y, 0.06, 1.0, 0.0, 3)[0] for x, y in places[:200])


def test_a_close_up_resolves_grains_and_a_navcam_does_not() -> None:
    sun = Sun.from_angles(math.radians(240), math.radians(40))
    scene = scene_from_terrain(plane(), radius_m=1.0, far_m=1.0, stones_per_m2=0.0, gravel=0.0)
    changes = []
    for away in (0.06, 2.0):
        camera = pinhole(focal_px=1200, width=96, height=96, center=(0, 0, away), forward=(0.001, 0, -1))
        plain, grainy = (
            Renderer(scene, look=look).render(camera, None, sun, exposure=1.0, seed=2).unit
            for look in (Look(), Look(close_up=1.0))
        )
        changes.append(float(np.abs(plain - grainy).mean() / plain.mean()))
    assert changes[0] > 0.05
    assert changes[1] == 0.0


# ---- bad input


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"families": {"pebble": 1.0}}, "rock family 'pebble' is not known"),
        ({"families": {}}, "weights of families"),
        ({"families": {"slab": -1.0}}, "weights of families"),
        ({"stones": ()}, "no albedo family"),
        ({"dust": (0.8, 0.2)}, "dust is"),
        ({"pavement": 1.4}, "pavement is 1.4"),
        ({"pavement": math.nan}, "pavement is nan"),
        ({"buried": -0.1}, "buried is -0.1"),
        ({"plate_m": 0.05}, "plates are 0.05 m"),
    ],
)
def test_an_impossible_geology_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(TerrainFormatError, match=message):
        replace(Geology("x", {"slab": 1.0}, (AlbedoFamily(0.2, 0.01),)), **options)


def test_an_unknown_geology_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(TerrainFormatError, match="'mare' is not known; there are gusev, meridiani"):
        geology_named("mare")
    with pytest.raises(TerrainFormatError, match=r"albedo family 0\.9"):
        AlbedoFamily(0.9, 0.01)


def test_a_malformed_surface_or_family_of_a_file_is_named(tmp_path: Path) -> None:
    write_terrain(site(), tmp_path)
    told = json.loads((tmp_path / "terrain.json").read_text())
    (tmp_path / "terrain.json").write_text(json.dumps({**told, "surface": {"gravel": 7}}))
    with pytest.raises(TerrainFormatError, match="gravel"):
        load_terrain(tmp_path)
    (tmp_path / "terrain.json").write_text(json.dumps(told))
    rocks = json.loads((tmp_path / "rocks.json").read_text())
    rocks["rocks"][0]["family"] = "cheese"
    (tmp_path / "rocks.json").write_text(json.dumps(rocks))
    with pytest.raises(TerrainFormatError, match="family"):
        load_terrain(tmp_path)


@pytest.mark.parametrize(("name", "value"), [("ripples", 0.7), ("gravel_mottle", -1.0), ("close_up", 2.0)])
def test_a_look_that_cannot_be_is_refused(name: str, value: float) -> None:
    with pytest.raises(RenderError, match=str(value)):
        Look(**{name: value})


def test_edged_families_are_known_families() -> None:
    assert set(SHAPED) >= SHARP


def test_heights_of_a_plate_follow_its_sides_and_lean() -> None:
    square = tuple((k * math.pi / 2, 0.3) for k in range(4))
    plate = Rock(
        "B", 0.0, 0.0, 0.0, 0.85, 0.05, elongation=1.0, seed=2, family="plate", sides=square, lean=(0.1, 0.0)
    )
    heights = raise_rocks(np.zeros((81, 81)), -0.8, -0.8, 0.02, [plate])
    axis = np.arange(81) * 0.02 - 0.8
    x, y = np.meshgrid(axis, axis)
    assert not heights[(np.abs(x) > 0.33) | (np.abs(y) > 0.33)].any()
    inside = (np.abs(x) < 0.2) & (np.abs(y) < 0.2)
    slope = np.polyfit(x[inside], heights[inside], 1)[0]
    assert slope == pytest.approx(0.1, abs=0.03)
