"""The world when there is no robot."""
