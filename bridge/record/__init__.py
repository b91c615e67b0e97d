"""Recordings: MCAP in rosbag2 layout, written from the wire, read back, summarised and replayed."""
