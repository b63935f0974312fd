/* What a load on the platform says of a payload: `Scales.read` of `compensation/scales.py`. */
#include "wrist.h"

int read_load(const Mechanism *k, const Scales *scales, const Configuration *at,
              const double load[6], int on_platform, Reading *out) {
    double wrench[6], force[3];
    if (beyond_loads(k, load)) return BEYOND_LOADS;
    const double *platform = at->bodies[PLATFORM], *u = scales->axes[0], *v = scales->axes[1];
    for (int half = 0; half < 6; half += 3) {
        if (on_platform) apply(platform, load + half, wrench + half);
        else for (int i = 0; i < 3; i++) wrench[half + i] = load[half + i];
    }
    apply(scales->axes[0], wrench, force);
    apply(scales->axes[0], wrench + 3, out->moments);
    out->side = sqrt(force[0] * force[0] + force[1] * force[1]);
    out->weight = force[2];
    if (scales->gravity == 0.0) {
        out->side = sqrt(out->side * out->side + out->weight * out->weight);
        out->weight = 0.0;
    }
    apply_back(platform, v, out->rows[0]);
    apply_back(platform, u, out->rows[1]);
    for (int i = 0; i < 3; i++) out->rows[1][i] = -out->rows[1][i];
    return OK;
}
