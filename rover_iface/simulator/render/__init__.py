"""Images of the simulated world, and the truth behind every pixel.

::

    from rover_iface.simulator.render.from_terrain import scene_from_terrain
    from rover_iface.simulator.render.renderer import Renderer, Sun

    scene = scene_from_terrain(terrain, (x, y), seed=1)          # build once, a second or two
    renderer = Renderer(scene)
    frame = renderer.render(camera, pose, sun, window=(left, top, 161, 161), sensor=sensor, seed=7)
    frame.image          # uint8 or uint16, (height, width)
    frame.camera         # CameraModel of that window, site frame
    frame.truth.range_m, frame.truth.point_site, frame.truth.object_id(line, sample), frame.truth.lit

`camera` is a `CameraModel` in the rover frame (`CameraRig.camera("navcam_left", pan, tilt)`), `pose` a
`rover_iface.frames.Pose` or `Transform` (None when the camera is in the site frame already), `sun` a `Sun`
(`Sun(SunClock(...).direction(t_s))` for a moment of the day). `renderer.depth(camera, pose, step=4)` and
`scene.ranges(origins, directions)` cast ranges without an image. Same arguments, same pixels.
"""
