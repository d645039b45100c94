"""Pictures of a real site made into terrain.

- `frames_of_labels`: a flight image with its camera in the site frame, from what its label says.
- `picture_pairs`: the pairs of a folder, by their labels or by the description `image-pairs/1`.
- `row_check`: whether the two cameras of a pair agree about the rows of what both see.
- `pair_surface`: what a pair ranges, as a surface of neighbouring pixels with its uncertainty.
- `fusion`: surfaces of pairs as one height grid, its uncertainty and its ortho image.
- `site_model`: all of it, in order: `reconstruct(folder)`.
"""
