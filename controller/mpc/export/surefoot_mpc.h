/* One control step of the MPC admittance law: model terms, limits, problem, OSQP, check. No allocation. */
#ifndef SUREFOOT_MPC_H
#define SUREFOOT_MPC_H

#include "surefoot_layout.h"

/* What a step rests on. Directions: x forward, y left, yaw, column height; SI units; arrays by stage, then direction. */
typedef struct {
  double height;                          /* commanded height of the column [m] */
  double velocity[4];                     /* commanded velocity */
  double previous[4];                     /* acceleration applied until now */
  double wrench[6];                       /* of the person at the interface: force [N], torque [N m] */
  double draw[4];                         /* force that draws the command to the measured motion */
  double damping[4 * SUREFOOT_STAGES];    /* D_k of the rendered admittance */
  double stiffness[4 * SUREFOOT_STAGES];  /* K_k + K_hold */
  double load[4 * SUREFOOT_STAGES];       /* spring forces at the present pose */
} SurefootInstant;

typedef enum {
  SUREFOOT_PLAN = 0,       /* the only one that comes with an acceleration to apply */
  SUREFOOT_NOT_FINITE,     /* an input, or the problem made of it, is not a number */
  SUREFOOT_CROSSED,        /* a lower bound exceeds its upper bound */
  SUREFOOT_INFEASIBLE,
  SUREFOOT_UNBOUNDED,
  SUREFOOT_ITERATIONS,     /* the iteration limit was reached and the answer is not good enough */
  SUREFOOT_INACCURATE,     /* the answer is off by more than the limit, whatever the solver says */
  SUREFOOT_FAILED
} SurefootStatus;

typedef struct {
  double acceleration[4]; /* to apply over the coming period; zero unless the status is SUREFOOT_PLAN */
  double residuals[3];    /* feasibility, stationarity, duality gap */
  int iterations;
} SurefootCommand;

/* Must be called once, before any step. */
void surefoot_mpc_init(void);

/* Bounded in time by OSQP's iterations. Anything but SUREFOOT_PLAN is not a command: fall back, then stop. */
SurefootStatus surefoot_mpc_step(const SurefootInstant *instant, SurefootCommand *command);

const char *surefoot_mpc_reason(SurefootStatus status);

#endif
