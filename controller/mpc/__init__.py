"""The MPC admittance law: problem, solver and plan."""
