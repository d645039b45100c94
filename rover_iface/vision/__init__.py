"""Trackers with confidence and covariance, camera hand-off.

`tracker` holds the `Tracker` Protocol and its values, `ncc` the correlation tracker flown on Opportunity,
`sift` the feature tracker of K9, `template` the prediction and search of image patches that both hand-off
and tracking use.
"""
