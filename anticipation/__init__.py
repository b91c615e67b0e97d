"""A window of keypoints -> the fall-state horizon."""
