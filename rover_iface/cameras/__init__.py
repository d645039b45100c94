"""Cameras of a rover.

- `model`: `CameraModel` (CAHV, CAHVOR, CAHVORE): `project`, `back_project`, `jacobian`,
  `transformed`, `window`, `scaled`; `pinhole(...)` makes a simple one.
- `linear`: `linearised`, `aligned_pair`, `warp`.
- `labels`: `read_product` for PDS3, VICAR and Mars 2020 JSON.
- `rig`: `load_cameras("mer")`, `CameraRig` with the pan-tilt mast and `point_at`.
- `stereo`: point stereo, dense stereo, cloud with covariance.
"""
