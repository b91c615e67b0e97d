"""Other solvers on the controller's own problems."""
