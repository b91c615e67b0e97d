"""Offline assessment of keypoint recordings through the code that runs live."""
