"""Camera, video or recording -> twelve cleaned keypoints in the image."""
