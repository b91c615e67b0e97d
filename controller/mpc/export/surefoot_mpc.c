#include "surefoot_mpc.h"

#include <math.h>
#include <string.h>

#include "loops.c" /* one translation unit: the checks and products of the Python controller */
#include "osqp.h"
#include "surefoot_kernels.h"
#include "surefoot_osqp_workspace.h"

#define SOLVED 1
#define SOLVED_INACCURATE 2
#define PRIMAL_INFEASIBLE 3
#define PRIMAL_INFEASIBLE_INACCURATE 4
#define DUAL_INFEASIBLE 5
#define DUAL_INFEASIBLE_INACCURATE 6
#define MAX_ITER_REACHED 7

static double P[SUREFOOT_COST_COUNT], q[SUREFOOT_N], A[SUREFOOT_CONSTRAINT_COUNT];
static double lower[SUREFOOT_M], upper[SUREFOOT_M], low[SUREFOOT_M], high[SUREFOOT_M];
static double x[SUREFOOT_N], y[SUREFOOT_M], flaw_sums[4], residual_values[4], tipping[20];
static double room[SUREFOOT_N + SUREFOOT_M + SUREFOOT_STAGES * (SUREFOOT_STAGES + 4)];
static double damping[4 * SUREFOOT_STAGES], stiffness[4 * SUREFOOT_STAGES], linearised;
static int fresh, adapted;
static Workspace workspace;

void surefoot_mpc_init(void) {
  memset(&workspace, 0, sizeof workspace);
  workspace.stages = SUREFOOT_STAGES;
  workspace.n = SUREFOOT_N, workspace.m = SUREFOOT_M;
  workspace.cost_count = SUREFOOT_COST_COUNT, workspace.constraint_count = SUREFOOT_CONSTRAINT_COUNT;
  workspace.cost_columns = surefoot_cost_columns, workspace.cost_rows = surefoot_cost_rows;
  workspace.constraint_columns = surefoot_constraint_columns;
  workspace.constraint_rows = surefoot_constraint_rows;
  workspace.P = P, workspace.q = q, workspace.A = A, workspace.lower = lower, workspace.upper = upper;
  workspace.x = x, workspace.y = y, workspace.flaws = flaw_sums, workspace.residuals = residual_values;
  workspace.room = room;
  linearised = NAN;
  fresh = 1, adapted = 0;
}

const char *surefoot_mpc_reason(SurefootStatus status) {
  static const char *const reasons[] = {
      "plan",
      "the problem is not finite",
      "a lower bound of the problem exceeds its upper bound",
      "the problem has no feasible motion",
      "the problem is unbounded",
      "the solver reached its iteration limit",
      "the answer is off",
      "the solver failed",
  };
  return reasons[status];
}

/* Fill the problem; returns whether its matrices changed. */
static int pose(const SurefootInstant *instant) {
  double point[20];
  int changed = !(fabs(instant->height - linearised) <= SUREFOOT_RELINEARISE_M);
  if (changed) linearised = instant->height;
  point[0] = instant->height, point[1] = linearised;
  memcpy(point + 2, instant->velocity, sizeof instant->velocity);
  memcpy(point + 6, instant->previous, sizeof instant->previous);
  memcpy(point + 10, instant->wrench, sizeof instant->wrench);
  memcpy(point + 16, instant->draw, sizeof instant->draw);
  if (memcmp(damping, instant->damping, sizeof damping) || memcmp(stiffness, instant->stiffness, sizeof stiffness)) {
    memcpy(damping, instant->damping, sizeof damping);
    memcpy(stiffness, instant->stiffness, sizeof stiffness);
    changed = 1;
  }
  if (changed) {
    const double *arguments[SUREFOOT_MATRICES_ARG] = {damping, stiffness, &linearised};
    double *results[SUREFOOT_MATRICES_RES] = {P, A};
    long long int iw[SUREFOOT_MATRICES_IW + 1];
    double w[SUREFOOT_MATRICES_W + 1];
    matrices(arguments, results, iw, w, 0);
  }
  {
    const double *arguments[SUREFOOT_VECTORS_ARG] = {point, damping, stiffness, instant->load};
    double *results[SUREFOOT_VECTORS_RES] = {q, lower, upper, tipping};
    long long int iw[SUREFOOT_VECTORS_IW + 1];
    double w[SUREFOOT_VECTORS_W + 1];
    vectors(arguments, results, iw, w, 0);
  }
  double sum = 0.0;
  for (int i = 0; i < 20; i++) sum += point[i];
  /* A maximum in a bound passes over what is not a number; q does not. */
  if (!isfinite(sum)) q[0] = NAN;
  return changed;
}

SurefootStatus surefoot_mpc_step(const SurefootInstant *instant, SurefootCommand *command) {
  int changed = pose(instant), from_nothing = fresh;
  memset(command, 0, sizeof *command);
  fresh = 1; /* after any failure the solver starts anew */
  flaws(&workspace);
  if (!isfinite(flaw_sums[0] + flaw_sums[1] + flaw_sums[2])) return SUREFOOT_NOT_FINITE;
  if (flaw_sums[3] != 0.0) return SUREFOOT_CROSSED;
  for (int i = 0; i < SUREFOOT_M; i++) {
    low[i] = lower[i] > -OSQP_INFTY ? lower[i] : -OSQP_INFTY;
    high[i] = upper[i] < OSQP_INFTY ? upper[i] : OSQP_INFTY;
  }
  OSQPSolver *solver = &surefoot_osqp_solver;
  OSQPInt bad = 0;
  if (from_nothing || adapted) bad |= osqp_update_rho(solver, SUREFOOT_STEP_SIZE);
  bad |= osqp_update_data_vec(solver, q, low, high);
  if (from_nothing || changed)
    bad |= osqp_update_data_mat(solver, P, NULL, SUREFOOT_COST_COUNT, A, NULL, SUREFOOT_CONSTRAINT_COUNT);
  if (from_nothing) osqp_cold_start(solver);
  if (bad || osqp_solve(solver)) return SUREFOOT_FAILED;
  adapted = solver->info->rho_updates > 0;
  command->iterations = (int)solver->info->iter;
  switch (solver->info->status_val) {
    case SOLVED: case SOLVED_INACCURATE: case MAX_ITER_REACHED: break;
    case PRIMAL_INFEASIBLE: case PRIMAL_INFEASIBLE_INACCURATE: return SUREFOOT_INFEASIBLE;
    case DUAL_INFEASIBLE: case DUAL_INFEASIBLE_INACCURATE: return SUREFOOT_UNBOUNDED;
    default: return SUREFOOT_FAILED;
  }
  for (int i = 0; i < SUREFOOT_N; i++) x[i] = solver->solution->x[i];
  for (int i = 0; i < SUREFOOT_M; i++) y[i] = solver->solution->y[i];
  residuals(&workspace);
  memcpy(command->residuals, residual_values, sizeof command->residuals);
  if (!isfinite(residual_values[3])) return SUREFOOT_FAILED;
  for (int i = 0; i < 3; i++) /* what is not a number is not below the limit either */
    if (!(residual_values[i] <= SUREFOOT_RESIDUAL_MAX))
      return solver->info->status_val == MAX_ITER_REACHED ? SUREFOOT_ITERATIONS : SUREFOOT_INACCURATE;
  for (int axis = 0; axis < 4; axis++) command->acceleration[axis] = x[axis] * surefoot_acceleration[axis];
  fresh = 0;
  return SUREFOOT_PLAN;
}
