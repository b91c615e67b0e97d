/* Products, checks and condensing of the MPC's problem, in loops over its layout (controller/mpc/structure.py).

   The same functions exist as CasADi expressions (checks.py, condensing.py), which serve where there is no compiler
   and hold this file to their numbers in a test. Unrolled by CasADi they would be 60,000 lines of C and take a
   compiler a quarter of a minute; as loops they take it half a second and run faster.
   No allocation, no input or output, no state but what the workspace points to. */

#include <math.h>
#include <string.h>

#define AXES 4
#define WIDTH 12      /* decisions of a stage: acceleration, velocity, displacement */
#define PER_STAGE 7   /* numbers of one axis' cost per stage: aa, a a-before, vv, vp, va, pa, pp */
#define OPEN 1e30     /* what DAQP takes for no bound */
#define NO_PUSH 1e-9  /* a multiplier this small pushes against nothing */

typedef struct {
  int stages, limited, n, m, cost_count, constraint_count, condensed_rows;
  const int *limited_stages, *cost_columns, *cost_rows, *constraint_columns, *constraint_rows;
  double *P, *q, *A, *lower, *upper, *x, *y, *flaws, *residuals;
  /* condensed */
  const int *cost_sources, *constraint_sources, *order, *own_first;
  const double *dynamics;
  double *U, *M, *f, *low, *high, *z, *multipliers;
  double *room; /* n + m + stages * (stages + 4) */
} Workspace;

static double larger(double a, double b) { return a > b ? a : b; }

/* result = P x, P symmetric by its upper triangle */
static void curvature(const Workspace *w, const double *x, double *result) {
  memset(result, 0, sizeof(double) * w->n);
  for (int column = 0; column < w->n; column++)
    for (int at = w->cost_columns[column]; at < w->cost_columns[column + 1]; at++) {
      int row = w->cost_rows[at];
      result[row] += w->P[at] * x[column];
      if (row != column) result[column] += w->P[at] * x[row];
    }
}

/* result = A x */
static void constrain(const Workspace *w, const double *x, double *result) {
  memset(result, 0, sizeof(double) * w->m);
  for (int column = 0; column < w->n; column++)
    for (int at = w->constraint_columns[column]; at < w->constraint_columns[column + 1]; at++)
      result[w->constraint_rows[at]] += w->A[at] * x[column];
}

/* result += A' y */
static void pull_back(const Workspace *w, const double *y, double *result) {
  for (int column = 0; column < w->n; column++) {
    double sum = 0.0;
    for (int at = w->constraint_columns[column]; at < w->constraint_columns[column + 1]; at++)
      sum += w->A[at] * y[w->constraint_rows[at]];
    result[column] += sum;
  }
}

/* Sums of P, q and A (finite only if every term is), and how many pairs of bounds are not in order. */
void flaws(const Workspace *w) {
  double P = 0.0, q = 0.0, A = 0.0;
  int crossed = w->m;
  for (int i = 0; i < w->cost_count; i++) P += w->P[i];
  for (int i = 0; i < w->n; i++) q += w->q[i];
  for (int i = 0; i < w->constraint_count; i++) A += w->A[i];
  for (int i = 0; i < w->m; i++) crossed -= w->lower[i] <= w->upper[i];
  w->flaws[0] = P, w->flaws[1] = q, w->flaws[2] = A, w->flaws[3] = crossed;
}

/* Feasibility, stationarity and duality gap of x, y; and their sum, which is finite only if they are. */
void residuals(const Workspace *w) {
  double *pull = w->room, *value = w->room + w->n;
  double quadratic = 0.0, linear = 0.0, support = 0.0, whole = 0.0;
  double primal = 0.0, steepest = 0.0, cost = 0.0;
  curvature(w, w->x, pull);
  for (int i = 0; i < w->n; i++) {
    quadratic += w->x[i] * pull[i], linear += w->x[i] * w->q[i], whole += w->x[i];
    pull[i] += w->q[i];
    cost = larger(cost, fabs(w->q[i]));
  }
  pull_back(w, w->y, pull);
  for (int i = 0; i < w->n; i++) steepest = larger(steepest, fabs(pull[i]));
  constrain(w, w->x, value);
  for (int i = 0; i < w->m; i++) {
    double y = w->y[i];
    whole += y;
    primal = larger(primal, larger(w->lower[i] - value[i], value[i] - w->upper[i]));
    /* The dual cost takes a multiplier at the bound its sign pushes against; at an open one that is infinite. */
    if (y > NO_PUSH) support += y * w->upper[i];
    if (y < -NO_PUSH) support += y * w->lower[i];
  }
  double size = larger(larger(fabs(quadratic), fabs(linear)), fabs(support));
  w->residuals[0] = primal;
  w->residuals[1] = steepest / (1.0 + cost);
  w->residuals[2] = fabs(quadratic + linear + support) / (1.0 + size);
  w->residuals[3] = whole;
}

static double taken(const double *values, const int *sources, int count, int at) {
  return sources[at] < count ? values[sources[at]] : 0.0;
}

static void scaled(double *row, double factor, const double *values, int count) {
  for (int c = 0; c < count; c++) row[c] = factor * values[c];
}

/* H of one axis from its part of P, in the upper triangle of U (N, N). */
static void hessian(const Workspace *w, int axis, double *U) {
  const int N = w->stages, *sources = w->cost_sources + axis * PER_STAGE * N;
  const double by_a = w->dynamics[3 * axis], square = w->dynamics[3 * axis + 1], by_v = w->dynamics[3 * axis + 2];
  const double slope = by_v * by_a; /* in p before stage k, a_j weighs first_k - slope j; in v, by_a */
  double s0 = 0.0, s1 = 0.0, s2 = 0.0;
  for (int j = N - 1; j >= 0; j--) {
    double e[PER_STAGE], first = slope * (j - 1) + square;
    for (int entry = 0; entry < PER_STAGE; entry++)
      e[entry] = taken(w->P, sources, w->cost_count, PER_STAGE * j + entry);
    for (int i = 0; i <= j; i++) {
      double value = s0 - slope * (i + j) * s1 + slope * slope * i * j * s2;
      if (i < j) value += e[4] * by_a + e[5] * (first - slope * i);
      if (i == j) value += e[0];
      if (i == j - 1) value += e[1];
      U[N * i + j] = value;
    }
    /* What the stages from j on add to every earlier pair. */
    s0 += e[2] * by_a * by_a + 2.0 * e[3] * by_a * first + e[6] * first * first;
    s1 += e[3] * by_a + e[6] * first;
    s2 += e[6];
  }
}

/* U = R^-1 with R' R = H, in place, upper triangles. Without curvature the result is not a number. */
static void invert(double *U, int N) {
  for (int i = 0; i < N; i++) {
    double root = 1.0 / sqrt(U[N * i + i]);
    for (int j = i; j < N; j++) U[N * i + j] *= root;
    for (int k = i + 1; k < N; k++) {
      double factor = U[N * i + k];
      for (int j = k; j < N; j++) U[N * k + j] -= factor * U[N * i + j];
    }
  }
  for (int i = N - 1; i >= 0; i--) {
    double inverse = 1.0 / U[N * i + i];
    double row[N];
    for (int c = i; c < N; c++) row[c] = 0.0;
    for (int k = i + 1; k < N; k++) {
      double factor = -inverse * U[N * i + k];
      for (int c = k; c < N; c++) row[c] += factor * U[N * k + c];
    }
    row[i] = inverse;
    for (int c = i; c < N; c++) U[N * i + c] = row[c];
    for (int c = 0; c < i; c++) U[N * i + c] = 0.0;
  }
}

/* U and M from P and A. */
void condense(const Workspace *w) {
  const int N = w->stages, S = w->limited, all = AXES * N, numbers = PER_STAGE * N + 14 * S;
  for (int axis = 0; axis < AXES; axis++) {
    double *U = w->U + axis * N * N, *v = w->room, *p = w->room + N;
    const int *sources = w->constraint_sources + axis * numbers;
    const double by_a = w->dynamics[3 * axis], square = w->dynamics[3 * axis + 1], by_v = w->dynamics[3 * axis + 2];
    double *own = w->M + (size_t)w->own_first[axis] * all + axis * N;
    double *shared = w->M + (size_t)w->own_first[AXES] * all + axis * N;
    int at = 0, place = 0;
    hessian(w, axis, U);
    invert(U, N);
    for (int k = 0; k < N; k++) {
      const double *row = U + N * k;
      scaled(own + all * k, taken(w->A, sources, w->constraint_count, at++), row, N);
      double now = taken(w->A, sources, w->constraint_count, at++);
      double then = taken(w->A, sources, w->constraint_count, at++);
      double *jerk = own + all * (N + k);
      for (int c = 0; c < N; c++) jerk[c] = now * row[c] + (k ? then * row[c - N] : 0.0);
      for (int edge = 0; edge < 4; edge++)
        scaled(shared + all * (12 * S + 4 * k + edge), taken(w->A, sources, w->constraint_count, at++), row, N);
    }
    memset(v, 0, sizeof(double) * 2 * N);
    for (int k = 0; k < N; k++) {
      const double *row = U + N * k;
      for (int c = 0; c < N; c++) p[c] += by_v * v[c] + square * row[c];
      for (int c = 0; c < N; c++) v[c] += by_a * row[c];
      if (place == S || w->limited_stages[place] != k) continue;
      scaled(own + all * (2 * N + place), taken(w->A, sources, w->constraint_count, at++), v, N);
      double stroke = taken(w->A, sources, w->constraint_count, at++);
      if (axis == AXES - 1) scaled(own + all * (2 * N + S + place), stroke, p, N);
      for (int wheel = 0; wheel < 4; wheel++)
        scaled(shared + all * (4 * place + wheel), taken(w->A, sources, w->constraint_count, at++), v, N);
      for (int drive = 0; drive < 8; drive++)
        scaled(shared + all * (4 * S + 8 * place + drive), taken(w->A, sources, w->constraint_count, at++), row, N);
      place++;
    }
  }
}

/* The motion of accelerations u (axis by axis; none: NULL) under the dynamics' right side. */
static void move(const Workspace *w, const double *u, double *x) {
  const int N = w->stages;
  for (int axis = 0; axis < AXES; axis++) {
    const double by_a = w->dynamics[3 * axis], square = w->dynamics[3 * axis + 1], by_v = w->dynamics[3 * axis + 2];
    double v = 0.0, p = 0.0;
    for (int k = 0; k < N; k++) {
      double a = u ? u[N * axis + k] : 0.0;
      p += by_v * (v + w->lower[AXES * N + AXES * k + axis]) + square * a;
      v += by_a * a + 0.25 * w->lower[AXES * k + axis];
      x[WIDTH * k + axis] = a, x[WIDTH * k + 4 + axis] = v, x[WIDTH * k + 8 + axis] = p;
    }
  }
}

/* f, low and high of the condensed problem from P, q, A, the bounds and U. */
void reduce(const Workspace *w) {
  const int N = w->stages;
  double *gradient = w->room, *value = w->room + w->n, *f = w->room + w->n + w->m;
  move(w, NULL, w->x);
  curvature(w, w->x, gradient);
  constrain(w, w->x, value);
  for (int i = 0; i < w->n; i++) gradient[i] += w->q[i];
  for (int axis = 0; axis < AXES; axis++) {
    const double by_a = w->dynamics[3 * axis], square = w->dynamics[3 * axis + 1], by_v = w->dynamics[3 * axis + 2];
    const double *U = w->U + axis * N * N;
    double *turned = w->f + N * axis, to_v = 0.0, to_p = 0.0;
    for (int k = N - 1; k >= 0; k--) {
      to_v += by_v * to_p + gradient[WIDTH * k + 4 + axis];
      to_p += gradient[WIDTH * k + 8 + axis];
      f[k] = gradient[WIDTH * k + axis] + by_a * to_v + square * to_p;
    }
    for (int c = 0; c < N; c++) turned[c] = 0.0;
    for (int k = 0; k < N; k++)
      for (int c = k; c < N; c++) turned[c] += U[N * k + c] * f[k];
  }
  for (int i = 0; i < w->condensed_rows; i++) {
    int row = w->order[i];
    double low = w->lower[row] - value[row], high = w->upper[row] - value[row];
    w->low[i] = low > -OPEN ? low : -OPEN;
    w->high[i] = high < OPEN ? high : OPEN;
  }
}

/* x and y of the full problem from z and the multipliers of M z. */
void expand(const Workspace *w) {
  const int N = w->stages;
  double *pull = w->room, *u = w->room + w->n;
  for (int axis = 0; axis < AXES; axis++)
    for (int k = 0; k < N; k++) {
      const double *row = w->U + axis * N * N + N * k;
      double sum = 0.0;
      for (int c = k; c < N; c++) sum += row[c] * w->z[N * axis + c];
      u[N * axis + k] = sum;
    }
  move(w, u, w->x);
  memset(w->y, 0, sizeof(double) * w->m);
  for (int i = 0; i < w->condensed_rows; i++) w->y[w->order[i]] = w->multipliers[i];
  curvature(w, w->x, pull);
  for (int i = 0; i < w->n; i++) pull[i] += w->q[i];
  pull_back(w, w->y, pull);
  /* What the dynamics' multipliers must be for the gradient to vanish along the states. */
  for (int axis = 0; axis < AXES; axis++) {
    double by_v = w->dynamics[3 * axis + 2], to_v = 0.0, to_p = 0.0;
    for (int k = N - 1; k >= 0; k--) {
      to_v += 0.25 * (to_p - pull[WIDTH * k + 4 + axis]);
      to_p -= by_v * pull[WIDTH * k + 8 + axis];
      w->y[AXES * k + axis] = to_v;
      w->y[AXES * N + AXES * k + axis] = to_p;
    }
  }
}
