"""Certificates of the roles: made, checked, shown."""
