/* Forward kinematics, domain and Jacobian at one pose (see kinematics.py, workspace.py). */
#include <math.h>
#include <string.h>

#include "wrist.h"

int forward(const Mechanism *k, const double theta[2], Configuration *at) {
    if (!(isfinite(theta[0]) && isfinite(theta[1]))) return UNREACHABLE;
    const double by[5] = {1.0, cos(theta[0]), sin(theta[0]), cos(theta[1]), sin(theta[1])};
    double turned[24];
    for (int i = 0; i < 24; i++) {
        turned[i] = 0.0;
        for (int j = 0; j < 5; j++) turned[i] += k->turn[i][j] * by[j];
    }
    double *b = at->b, *c = at->c, *d = at->d;
    memcpy(at->theta, theta, sizeof at->theta);
    memcpy(b, turned + 18, 3 * sizeof *b);
    memcpy(d, turned + 21, 3 * sizeof *d);
    const double cos_2 = k->cosines[0], cos_3 = k->cosines[1], kk = dot3(b, d);
    const double gram =
        1.0 - kk * kk - cos_2 * cos_2 - cos_3 * cos_3 + 2.0 * cos_2 * cos_3 * kk;
    if (!(gram > k->gram_rounding)) return UNREACHABLE;
    const double determinant = at->singularity = k->assembly_mode * sqrt(gram);
    double across[3], to_c[2][3];
    cross3(b, d, across);
    const double scale = 1.0 / (1.0 - kk * kk);
    const double p = (cos_2 - kk * cos_3) * scale, q = (cos_3 - kk * cos_2) * scale;
    for (int i = 0; i < 3; i++) c[i] = p * b[i] + q * d[i] + determinant * scale * across[i];
    /* The closure is exact only to rounding; unit length keeps the rotations orthonormal. */
    const double length = sqrt(dot3(c, c));
    for (int i = 0; i < 3; i++) c[i] /= length;
    cross3(b, c, to_c[0]);
    cross3(d, c, to_c[1]);
    for (int i = 0; i < 3; i++) {
        at->dual[i] = to_c[1][i] / determinant;
        at->dual[3 + i] = across[i] / determinant;
        at->dual[6 + i] = -to_c[0][i] / determinant;
    }
    memset(at->bodies[FRAME], 0, sizeof at->bodies[FRAME]);
    for (int i = 0; i < 3; i++) at->bodies[FRAME][4 * i] = 1.0;
    for (int side = 0; side < 2; side++) {
        const double *driven = side ? d : b, *inverse = k->home_inverse[side];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                at->bodies[LINK_1 + side][3 * j + i] = turned[9 * side + 3 * i + j];
                at->bodies[PLATFORM + side][3 * j + i] = inverse[3 * i] * driven[j] +
                    inverse[3 * i + 1] * c[j] + inverse[3 * i + 2] * to_c[side][j];
            }
    }
    return OK;
}

int in_domain(const Mechanism *k, const Configuration *at) {
    for (int i = 0; i < 2; i++)
        if (!(k->edges[i][0] <= at->theta[i] && at->theta[i] <= k->edges[i][1])) return OUTSIDE;
    return fabs(at->singularity) < k->least_singularity ? SINGULAR : OK;
}

void jacobian_of(const Mechanism *k, const Configuration *at, double jacobian[6]) {
    const double about_b[2] = {-dot3(at->dual, k->axes[0]), dot3(at->dual, k->axes[1])};
    for (int i = 0; i < 3; i++) {
        jacobian[2 * i] = k->axes[0][i] + at->b[i] * about_b[0];
        jacobian[2 * i + 1] = at->b[i] * about_b[1];
    }
}

/* Variances of the table's stated error and of an encoder count (see model/error_model.py). */
void table_covariance(const Mechanism *k, const Configuration *at, const double twist[6],
                      double of_size, double of_step, double covariance[36]) {
    double j[6];
    jacobian_of(k, at, j);
    const double shift = of_size * dot3(twist, twist);
    const double turn = of_size * dot3(twist + 3, twist + 3);
    memset(covariance, 0, 36 * sizeof *covariance);
    for (int row = 0; row < 3; row++) {
        for (int col = 0; col < 3; col++)
            covariance[6 * (3 + row) + 3 + col] =
                of_step * (j[2 * row] * j[2 * col] + j[2 * row + 1] * j[2 * col + 1]);
        covariance[7 * row] += shift;
        covariance[7 * (3 + row)] += turn;
    }
}
