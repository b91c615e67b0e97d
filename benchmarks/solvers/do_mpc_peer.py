"""do-mpc with IPOPT on the very same problem: cost and limits of each stage are its time-varying numbers."""

from __future__ import annotations

from typing import Any

import casadi as ca
import do_mpc
import numpy as np

from benchmarks.solvers.peer import Instance
from controller.mpc import condensing
from controller.mpc.structure import VELOCITY_SCALE, Structure

_WIDTHS = {"acceleration": 4, "jerk": 4, "velocity": 4, "wheel_speed": 4, "stroke": 1, "drive": 8, "tip_over": 4}
_OPEN = 1e4  # in scaled units: no limit at this stage


class DoMpc:
    """A discrete model with 12 states (v, p, the acceleration before) and 4 inputs, N = 20."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._condensed = condensing.build(structure)
        N = self._stages = structure.setting.stages
        model = do_mpc.model.Model("discrete", "SX")
        v, p, before = (model.set_variable("_x", name, (4, 1)) for name in ("v", "p", "before"))
        a = model.set_variable("_u", "a", (4, 1))
        cost = model.set_variable("_tvp", "cost", (28, 1))
        linear = model.set_variable("_tvp", "linear", (12, 1))
        right = model.set_variable("_tvp", "right", (8, 1))
        rows = model.set_variable("_tvp", "rows", (48, 1))
        jerk = model.set_variable("_tvp", "jerk", (4, 1))
        low, high = (model.set_variable("_tvp", name, (sum(_WIDTHS.values()), 1)) for name in ("low", "high"))
        by_a, square, by_v = (ca.DM(column) for column in self._condensed.dynamics.T)
        v_next = v + by_a * a + 0.25 * right[:4]
        p_next = p + by_v * (v + right[4:]) + square * a
        model.set_rhs("v", v_next)
        model.set_rhs("p", p_next)
        model.set_rhs("before", a)
        model.setup()
        # From here on the model's own symbols stand for what was declared.
        v, p, before, a = model.x["v"], model.x["p"], model.x["before"], model.u["a"]
        cost, linear, right, rows, jerk, low, high = (
            model.tvp[name] for name in ("cost", "linear", "right", "rows", "jerk", "low", "high")
        )
        v_next = v + by_a * a + 0.25 * right[:4]
        p_next = p + by_v * (v + right[4:]) + square * a

        aa, ab, vv, vp, va, pa, pp = (cost[4 * entry : 4 * entry + 4] for entry in range(7))
        stage = ca.sum1(
            0.5 * (aa * a * a + vv * v * v + pp * p * p) + ab * before * a + vp * v * p + va * v * a + pa * p * a
        )
        stage += ca.dot(linear, ca.vertcat(a, v, p))
        mpc = do_mpc.controller.MPC(model)
        mpc.settings.n_horizon, mpc.settings.t_step = N, structure.setting.stage_s
        mpc.settings.store_full_solution = False
        mpc.settings.nlpsol_opts = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-8}
        mpc.set_objective(lterm=stage, mterm=ca.DM(0) * ca.sum1(v))
        mpc.set_rterm(a=0.0)
        wheel = ca.DM(structure.setting.wheel_speed * structure.setting.velocity[:3])
        matrix = ca.reshape(rows, 4, 12).T
        values = {
            "acceleration": a,
            "jerk": jerk * (a - before),
            "velocity": VELOCITY_SCALE * v_next,
            "wheel_speed": wheel @ v_next[:3],
            "stroke": p_next[3],
            "drive": matrix[:8, :] @ a,
            "tip_over": matrix[8:, :] @ a,
        }
        first = 0
        for kind, width in _WIDTHS.items():
            where = slice(first, first + width)
            if kind != "tip_over":
                mpc.set_nl_cons(f"{kind}_low", low[where] - values[kind], ub=0.0)
            mpc.set_nl_cons(f"{kind}_high", values[kind] - high[where], ub=0.0)
            first += width
        self._template = mpc.get_tvp_template()
        mpc.set_tvp_fun(lambda _: self._template)
        mpc.setup()
        mpc.x0 = np.zeros(12)
        mpc.set_initial_guess()
        self._mpc = mpc

    def prepare(self, instance: Instance) -> Any:
        structure, N = self._structure, self._stages
        P, A = np.append(instance.P, 0.0), np.append(instance.A, 0.0)
        cost = P[self._condensed.cost_sources].reshape(4, N, 7)
        entries = A[self._condensed.constraint_sources]
        stage, limited = entries[:, : 7 * N].reshape(4, N, 7), structure.setting.sparse_stages
        drives = entries[:, 7 * N :].reshape(4, len(limited), 14)
        q = instance.q.reshape(N, 3, 4)
        low, high = instance.l, instance.u
        prepared = []
        for k in range(N):
            ends = np.zeros((2, 4)) if k == 0 else q[k - 1, 1:]
            rows = np.zeros((12, 4))
            rows[8:] = stage[:, k, 3:].T
            bounds = {kind: np.full((2, width), _OPEN) * [[-1.0], [1.0]] for kind, width in _WIDTHS.items()}
            for kind in ("acceleration", "jerk", "tip_over"):
                where = structure.rows[kind][k]
                bounds[kind] = np.stack([np.maximum(low[where], -_OPEN), np.minimum(high[where], _OPEN)])
            if k in limited:
                place = limited.index(k)
                rows[:8] = drives[:, place, 6:].T
                for kind in ("velocity", "wheel_speed", "stroke", "drive"):
                    where = structure.rows[kind][place]
                    bounds[kind] = np.stack([low[where], high[where]])
            right = [low[structure.rows[f"{kind}_dynamics"][k]] for kind in ("velocity", "displacement")]
            prepared.append(
                {
                    "cost": cost[:, k].T.ravel(),
                    "linear": np.concatenate([q[k, 0], *ends]),
                    "right": np.concatenate(right),
                    "rows": rows.ravel(),
                    "jerk": stage[:, k, 1],
                    "low": np.concatenate([bounds[kind][0] for kind in _WIDTHS]),
                    "high": np.concatenate([bounds[kind][1] for kind in _WIDTHS]),
                }
            )
        for k in range(N + 1):
            for name, values in prepared[min(k, N - 1)].items():
                self._template["_tvp", k, name] = values
        return None

    def solve(self, prepared: Any) -> np.ndarray | None:
        result = self._mpc.make_step(np.zeros(12))
        return np.array(result).ravel() if self._mpc.solver_stats["success"] else None
