"""Trackers with confidence and covariance, camera hand-off.

`tracker` holds the `Tracker` Protocol and its values, `ncc` the correlation tracker flown on Opportunity,
`sift` the feature tracker of K9, `shape` the registration of surfaces, `shape_tracker` both together.
`handoff` carries a target from one camera to another by the published methods, `handoff_cascade` by one that
tests itself. `template` is the prediction and search of image patches that all of them use.
"""
