"""The world when there is no robot: floor, walker, person and harness in MuJoCo."""
