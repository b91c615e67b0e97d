"""The fault suite: real processes, real wire, faults where the real thing fails."""
