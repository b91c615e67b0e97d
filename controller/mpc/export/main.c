/* Reads steps from standard input, an instant as the numbers of its struct in order, and prints a line for each:
   status, iterations, four accelerations, reason. For a target, call surefoot_mpc_step from its loop instead. */

#include <stdio.h>

#include "surefoot_mpc.h"

#define NUMBERS (sizeof(SurefootInstant) / sizeof(double))

int main(void) {
  static SurefootInstant instant; /* doubles throughout, in the order of the struct */
  double *numbers = (double *)&instant;
  SurefootCommand command;
  surefoot_mpc_init();
  for (;;) {
    for (size_t i = 0; i < NUMBERS; i++)
      if (scanf("%lf", &numbers[i]) != 1) return i == 0 && feof(stdin) ? 0 : 2;
    SurefootStatus status = surefoot_mpc_step(&instant, &command);
    const double *a = command.acceleration;
    printf("%d %d %.17g %.17g %.17g %.17g %s\n", status, command.iterations, a[0], a[1], a[2], a[3],
           surefoot_mpc_reason(status));
  }
}
