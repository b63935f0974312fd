/* Bristles of a joint that rubs, which slip where their force would exceed the budget (see
 * model/rubbing.py). */
#include "wrist.h"

enum { MAX_STEPS = 30 };
#define NEARLY 1e-8

void slip(long n, const double *moved, const double *compliance, const double *axes,
          const double *budget, double *force, double *feet) {
    static const double along[4] = {1.0, 0.0, 0.0, 1.0};
    for (long i = 0; i < n; i++, moved += 2, compliance += 2, force += 2, feet += 2) {
        const double *e = axes ? axes + 4 * i : along, x = feet[0], y = feet[1];
        double a = e[0] * (moved[0] - x) + e[2] * (moved[1] - y);
        double b = e[1] * (moved[0] - x) + e[3] * (moved[1] - y);
        double fa = a / compliance[0], fb = b / compliance[1], size = hypot(fa, fb);
        feet[2] = x;
        feet[3] = y;
        if (size > budget[i]) {
            double more = 0.0;
            for (int step = 0; step < MAX_STEPS; step++) {
                /* Newton's step for 1 / size, which is nearly straight in `more`. */
                const double slope = fa * fa / (compliance[0] + more) + fb * fb / (compliance[1] + more);
                const double off = size / budget[i] - 1.0;
                more += off * size * size / slope;
                fa = a / (compliance[0] + more);
                fb = b / (compliance[1] + more);
                if (fabs(off) <= NEARLY) break;
                size = hypot(fa, fb);
            }
            a = more * fa;
            b = more * fb;
            feet[2] += e[0] * a + e[1] * b;
            feet[3] += e[2] * a + e[3] * b;
        }
        force[0] = e[0] * fa + e[1] * fb;
        force[1] = e[2] * fa + e[3] * fb;
    }
}
