"""Pictures of a scene's triangles by a renderer that somebody else made: MuJoCo's, in OpenGL, off screen.

Only geometry is ours. Triangles, their normals and the albedo of each body go into a model; the ground and
each side of a stone get a texture made of a real frame's grain; light, shade and perspective are MuJoCo's.
A pinhole camera becomes a frustum that is not symmetric, so the principal point needs no resampling; a camera
with distortion is refused. Pictures are rendered three times as fine and averaged: what is thinner than a
pixel is not sampled, but averaged.

Needs PyOpenGL (`studies/offscreen.txt`) and a driver that draws without a screen: `MUJOCO_GL=egl`, set
here if nothing else is, with Debian's libegl1 and libgl1-mesa-dri, or `MUJOCO_GL=osmesa` with libosmesa6.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel, ModelKind
from rover_iface.errors import CameraError
from rover_iface.simulator.render.picture import Truth
from rover_iface.simulator.render.renderer import Sun
from rover_iface.simulator.render.scene import Scene

os.environ.setdefault("MUJOCO_GL", "egl")

Array = npt.NDArray[np.float64]
Grey = npt.NDArray[np.float32]
FINE = 3
"""Pixels rendered to one of the picture, along each axis."""
TEXEL_M, TILE, SEAM = 0.001, 4096, 512
"""A navcam's pixel is 1.5 mm at the last stop; the texture repeats after 4 m, over a seam of half a metre."""
TEXTURE_MEAN = 0.42
"""What the mean of the grain is in the texture: 2.4 times as bright is its end."""
BRIGHTEST = 0.30
"""Albedo that is white before the texture: that of the brightest body."""
SHADOW_TEXELS, SHADOW_HALF_M = 4096, 4.0
SKY = 0.35
LIMITS_M = 0.3, 120.0
FINER, FINER_SHARE = 4.83, 0.7
"""A second copy of the grain, smaller by this, for what the frame's camera resolved no more."""


def baked(grain: Grey, pixel_m: float, shift: Array) -> npt.NDArray[np.uint8]:
    """Return a texture (rows, columns) of texels of `TEXEL_M` that repeats without a seam.

    Grain is in multiples of its mean, `pixel_m` metres a pixel.
    """
    import cv2

    at = np.arange(TILE + SEAM, dtype=np.float64) * (TEXEL_M / pixel_m)
    small = np.ones((len(at), len(at)), np.float32)
    for scale, share, (x, y) in ((1.0, 1.0, shift[0]), (FINER, FINER_SHARE, shift[1])):
        # a texel of the finer copy is the mean of what lies in it
        blurred = cv2.GaussianBlur(grain, (0, 0), max(0.3, 0.4 * scale * TEXEL_M / pixel_m))
        u, v = np.meshgrid((scale * at + x).astype(np.float32), (scale * at + y).astype(np.float32))
        layer = cv2.remap(blurred, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
        small *= 1.0 + np.float32(share) * (layer - 1.0)
    for _ in range(2):
        small = _closed(small).T
    return np.clip(np.round(255.0 * TEXTURE_MEAN * small), 0, 255).astype(np.uint8)


def _closed(grain: Grey) -> Grey:
    """Return a texture whose first rows go over from what would follow its last ones."""
    share = ((np.arange(SEAM, dtype=np.float32) + 0.5) / SEAM)[:, None]
    out = grain[:TILE].copy()
    out[:SEAM] = share * grain[:SEAM] + (1.0 - share) * grain[TILE:]
    return out


class MujocoPictures:
    """Takes pictures of a scene: one model and one OpenGL context, kept until `close`."""

    def __init__(self, scene: Scene, texture: npt.NDArray[np.uint8], largest: tuple[int, int]) -> None:
        import mujoco

        self.scene, self.largest = scene, largest
        width, height = FINE * largest[0], FINE * largest[1]
        model = model_of(scene, texture, width, height).compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        self._window = mujoco.GLContext(width, height)
        self._window.make_current()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._shown = mujoco.MjvScene(model, maxgeom=model.ngeom)
        options, eye = mujoco.MjvOption(), mujoco.MjvCamera()
        mujoco.mjv_updateScene(model, data, options, None, eye, mujoco.mjtCatBit.mjCAT_ALL, self._shown)
        for flag, on in (("SHADOW", True), ("SKYBOX", True), ("REFLECTION", False), ("HAZE", False)):
            self._shown.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = on

    def light(self, camera: CameraModel, sun: Sun, middle: Array) -> Grey:
        """Return the light (height, width), 0..1, that falls into a camera of the site frame.

        Shadows are cast round `middle` (3,), m, as far as it is away, 4 m at least.

        Raises
        ------
        CameraError
            If the camera distorts, or its pictures are larger than was told.
        """
        import mujoco

        if camera.width > self.largest[0] or camera.height > self.largest[1]:
            raise CameraError(f"a picture of {camera.size} px; the largest was to be {self.largest} px")
        centre, half_width, bottom, top, up = frustum(camera)
        for eye in self._shown.camera:
            eye.pos, eye.forward, eye.up = camera.C, camera.A, up
            eye.frustum_center, eye.frustum_width = centre, half_width
            eye.frustum_bottom, eye.frustum_top = bottom, top
            eye.frustum_near, eye.frustum_far = LIMITS_M
        toward = np.array(sun.direction)
        sky, lamp = self._shown.lights[0], self._shown.lights[1]
        lamp.dir, lamp.pos = -toward, middle + 30.0 * toward
        ambient = sun.diffuse / (sun.direct + sun.diffuse)
        sky.ambient, lamp.diffuse = np.full(3, ambient), np.full(3, 1.0 - ambient)
        self._context.shadowClip = max(SHADOW_HALF_M, 1.2 * float(np.linalg.norm(middle - camera.C)))
        self._window.make_current()
        whole = mujoco.MjrRect(0, 0, FINE * camera.width, FINE * camera.height)
        fine = np.empty((whole.height, whole.width, 3), np.uint8)
        mujoco.mjr_render(whole, self._shown, self._context)
        mujoco.mjr_readPixels(fine, None, whole, self._context)
        grey = fine[::-1, :, 0].reshape(camera.height, FINE, camera.width, FINE)
        return np.asarray(grey.mean(axis=(1, 3)) / 255.0, dtype=np.float32)

    def close(self) -> None:
        """Free the context."""
        self._context.free()
        self._window.free()


def frustum(camera: CameraModel) -> tuple[float, float, float, float, Array]:
    """Return a pinhole camera's view as OpenGL has it: centre and half width, bottom and top of the picture
    in the near plane (`LIMITS_M`), m, and the direction (3,) that is up in it, in the camera's frame.

    Raises
    ------
    CameraError
        If the camera distorts.
    """
    if camera.kind is not ModelKind.CAHV:
        raise CameraError(f"a {camera.kind} camera distorts; only CAHV is a frustum")
    near = LIMITS_M[0]
    left, right = ((edge - camera.hc) / camera.hs * near for edge in (-0.5, camera.width - 0.5))
    top, bottom = ((camera.vc - edge) / camera.vs * near for edge in (-0.5, camera.height - 0.5))
    up = (camera.vc * camera.A - camera.V) / camera.vs
    return 0.5 * (left + right), 0.5 * (right - left), bottom, top, np.asarray(up)


def cast_truth(scene: Scene, camera: CameraModel, sun: Sun) -> Truth:
    """Return what each pixel of a camera (site frame) sees, by rays through the scene's triangles."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    origins, rays = camera.back_project(np.stack((u, v), axis=-1).reshape(-1, 2).astype(np.float64))
    hits = scene.cast(origins, rays)
    seen = hits["primID"] >= 0
    range_m = np.where(seen, hits["tfar"], np.inf).astype(np.float32)
    normals = hits["Ng"] / np.maximum(np.linalg.norm(hits["Ng"], axis=1, keepdims=True), 1e-12)
    lit = np.zeros(len(seen), np.bool_)
    toward = np.broadcast_to(np.array(sun.direction), rays[seen].shape)
    points = origins[seen] + range_m[seen, None] * rays[seen] + 2e-3 * normals[seen]
    lit[seen] = (scene.cast(points, toward)["primID"] < 0) & ((normals[seen] * toward).sum(axis=1) > 0.0)
    shape = camera.height, camera.width
    objects = np.where(seen, scene.objects[np.maximum(hits["primID"], 0)], -1).astype(np.int32)
    return Truth(
        range_m.reshape(shape),
        objects.reshape(shape),
        lit.reshape(shape),
        normals.astype(np.float32).reshape(*shape, 3),
        scene.ids,
        camera,
        (0, 0, camera.width, camera.height),
    )


def model_of(scene: Scene, texture: npt.NDArray[np.uint8], width: int, height: int) -> Any:
    """Return a specification of a model with the scene's triangles, by material, side and albedo."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.quality.offsamples = 0
    spec.visual.quality.shadowsize = SHADOW_TEXELS
    # what is called a head light is the light of the sky here: no direction, no shade
    spec.visual.headlight.active = 1
    spec.visual.headlight.diffuse = spec.visual.headlight.specular = [0.0] * 3
    spec.stat.extent = 1.0
    spec.visual.map.shadowclip = SHADOW_HALF_M
    spec.visual.map.znear, spec.visual.map.zfar = LIMITS_M
    grey = np.repeat(texture[..., None], 3, axis=2)
    image = spec.add_texture(name="grain", type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=3)
    image.width, image.height, image.data = texture.shape[1], texture.shape[0], grey.tobytes()
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=[SKY] * 3,
        rgb2=[SKY] * 3,
        width=8,
        height=48,
    )
    spec.worldbody.add_light(
        name="sun", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, castshadow=True, specular=[0, 0, 0]
    )
    triangles = scene.triangles
    faces = scene.vertices[triangles]
    normal = np.abs(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]))
    side = np.where(scene.materials[scene.objects] == 0, 2, normal.argmax(axis=1))
    albedo = np.round(scene.albedo[triangles].mean(axis=1), 2)
    for number, (axis, bright) in enumerate(sorted({*zip(side.tolist(), albedo.tolist(), strict=True)})):
        part = triangles[(side == axis) & (albedo == np.float32(bright))]
        used, faces_of = np.unique(part, return_inverse=True)
        points = scene.vertices[used].astype(np.float64) + scene.origin
        across = [k for k in range(3) if k != axis]
        name = f"part_{number}"
        mesh = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = points.ravel()
        mesh.usernormal = scene.normals[used].astype(np.float64).ravel()
        mesh.usertexcoord = (points[:, across] / (TILE * TEXEL_M)).ravel()
        corners = faces_of.reshape(-1).astype(np.int32)
        mesh.userface = mesh.userfacenormal = mesh.userfacetexcoord = corners
        paint = spec.add_material(name=name, specular=0.0, shininess=0.0, rgba=[bright / BRIGHTEST] * 3 + [1])
        paint.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "grain"
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            material=name,
            contype=0,
            conaffinity=0,
        )
    return spec
