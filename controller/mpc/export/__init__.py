"""The MPC as C for a target without Python."""
