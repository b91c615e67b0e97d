"""Where frames come from: keypoint files, videos, folders of images, cameras."""
