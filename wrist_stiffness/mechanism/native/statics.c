/* Elastic answer of one pose with contact and own weight (see statics.py).
 *
 * Parts of one limb that turn with one body are summed to a group before any pose is known.  With
 * the load P on the platform, the forces s along the slides of joint_2 to joint_4 and the weight L
 * of link_3, the wrench on a group is, half by half,
 *
 *     v = -dual_0 (b . P) + K s + dual_2 (d . L),       K = (-dual_0, dual_1, dual_2)
 *     limb 1: P + v       limb 2: L - v, and past link_2: -v
 *
 * and by virtual work the same law carries the groups' screws to the platform and to the slides.
 */
#include <math.h>
#include <string.h>

#include "wrist.h"

static const int BODY[GROUPS] = {FRAME, LINK_1, FRAME, LINK_2, LINK_3};
static const int IN_LIMB_1[GROUPS] = {1, 1, 0, 0, 0};
enum { BASE_1 = 0, BASE_2 = 2, PAST_LINK_2 = 4 };

/* out (6) += M (6, n) v (n) */
static void add_product(const double *matrix, int n, const double *v, double *out) {
    for (int i = 0; i < 6; i++) {
        double sum = 0.0;
        for (int j = 0; j < n; j++) sum += matrix[i * n + j] * v[j];
        out[i] += sum;
    }
}

static void turned(const double *rotation, const double six[6], double out[6]) {
    apply(rotation, six, out);
    apply(rotation, six + 3, out + 3);
}

int respond(const Parts *parts, int m, const Configuration *at, const double wrench[6],
            const double *limb_1, const double *limb_2, const double *opening,
            unsigned char *closed, double twist[6], double *force) {
    const Sector *sectors = sectors_of(parts);
    const double *dual_0 = at->dual, *dual_1 = at->dual + 3, *dual_2 = at->dual + 6;
    double field[BODY_COUNT][3], weight[BODY_COUNT][6];
    for (int body = 0; body < BODY_COUNT; body++) {
        double own[6] = {0.0};
        apply_back(at->bodies[body], parts->gravity, field[body]);
        add_product(parts->weight[body], 3, field[body], own);
        turned(at->bodies[body], own, weight[body]);
    }
    double load[6], law[6];
    for (int i = 0; i < 6; i++) load[i] = wrench[i] + weight[PLATFORM][i];
    for (int half = 0; half < 6; half += 3) {
        const double by_b = -dot3(at->b, load + half), by_d = dot3(at->d, weight[LINK_3] + half);
        for (int i = 0; i < 3; i++) law[half + i] = by_b * dual_0[i] + by_d * dual_2[i];
    }

    double delta[GROUPS][6], on_group[GROUPS][6], to_slides[GROUPS][9], by_slide[GROUPS][18];
    double slide_flexibility[9] = {0.0}, k[9];
    for (int i = 0; i < 3; i++) {
        k[3 * i] = -dual_0[i];
        k[3 * i + 1] = dual_1[i];
        k[3 * i + 2] = dual_2[i];
    }
    for (int g = 0; g < GROUPS; g++) {
        const double *rotation = at->bodies[BODY[g]], *flexibility = parts->flexibility[g];
        double in_f[6], *u = on_group[g];
        for (int i = 0; i < 6; i++) {
            in_f[i] = IN_LIMB_1[g] ? load[i] + law[i] : -law[i];
            if (!IN_LIMB_1[g] && g != PAST_LINK_2) in_f[i] += weight[LINK_3][i];
            if (g == BASE_1) in_f[i] += weight[LINK_1][i];
            if (g == BASE_2) in_f[i] += weight[LINK_2][i];
        }
        apply_back(rotation, in_f, u);
        apply_back(rotation, in_f + 3, u + 3);
        memcpy(delta[g], parts->constant_screw[g], sizeof delta[g]);
        add_product(flexibility, 6, u, delta[g]);
        add_product(parts->weight_screw[g], 3, field[BODY[g]], delta[g]);
        /* What a unit force along each slide does; it has no moment. */
        double *s = to_slides[g], *bent = by_slide[g];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                const double sum = rotation[i] * k[j] + rotation[3 + i] * k[3 + j] +
                                   rotation[6 + i] * k[6 + j];
                s[3 * i + j] = IN_LIMB_1[g] ? sum : -sum;
            }
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 3; j++)
                bent[3 * i + j] = flexibility[6 * i] * s[j] + flexibility[6 * i + 1] * s[3 + j] +
                                  flexibility[6 * i + 2] * s[6 + j];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                slide_flexibility[3 * i + j] +=
                    s[i] * bent[j] + s[3 + i] * bent[3 + j] + s[6 + i] * bent[6 + j];
    }
    for (int i = 0; i < 6; i++) {
        if (limb_1) delta[BASE_1][i] += limb_1[i];
        if (limb_2) delta[BASE_2][i] += limb_2[i];
    }

    if (m > 0) {
        double slid[3] = {0.0}, half[MOST_SECTORS][3], gap[MOST_SECTORS], pushed[3] = {0.0};
        for (int g = 0; g < GROUPS; g++)
            for (int j = 0; j < 3; j++)
                slid[j] += to_slides[g][j] * delta[g][0] + to_slides[g][3 + j] * delta[g][1] +
                           to_slides[g][6 + j] * delta[g][2];
        for (int i = 0; i < m; i++) {
            const Sector *sector = sectors + i;
            const int g = (int)sector->group;
            const double *u = on_group[g], *s = to_slides[g];
            gap[i] = sector->gap + dot3(sector->screw, u) + dot3(sector->screw + 3, u + 3) +
                     dot3(sector->weight_gap, field[BODY[g]]) + dot3(sector->slide, slid);
            if (opening) gap[i] += opening[i];
            for (int j = 0; j < 3; j++)
                half[i][j] = sector->screw[0] * s[j] + sector->screw[1] * s[3 + j] +
                             sector->screw[2] * s[6 + j] +
                             0.5 * (sector->slide[0] * slide_flexibility[j] +
                                    sector->slide[1] * slide_flexibility[3 + j] +
                                    sector->slide[2] * slide_flexibility[6 + j]);
        }
        const int status = settle(parts, m, (const double (*)[3])half, gap, closed, force);
        if (status) return status;
        for (int i = 0; i < m; i++) {
            if (force[i] == 0.0) continue;
            const Sector *sector = sectors + i;
            double *own = delta[(int)sector->group];
            for (int j = 0; j < 3; j++) pushed[j] += force[i] * sector->slide[j];
            for (int j = 0; j < 6; j++) own[j] += force[i] * sector->screw[j];
        }
        for (int g = 0; g < GROUPS; g++) add_product(by_slide[g], 3, pushed, delta[g]);
    }

    double limbs[2][6] = {{0.0}, {0.0}};
    for (int g = 0; g < GROUPS; g++) {
        double in_f[6];
        turned(at->bodies[BODY[g]], delta[g], in_f);
        for (int i = 0; i < 6; i++) limbs[IN_LIMB_1[g]][i] += in_f[i];
    }
    for (int half = 0; half < 6; half += 3) {
        double apart[3];
        for (int i = 0; i < 3; i++) apart[i] = limbs[1][half + i] - limbs[0][half + i];
        const double by_b = -dot3(dual_0, apart);
        for (int i = 0; i < 3; i++) twist[half + i] = limbs[1][half + i] + by_b * at->b[i];
    }
    return OK;
}

int predict(const Mechanism *k, const Parts *parts, int m, const double theta[2],
            const double load[6], int on_platform, unsigned char *closed, double twist[6],
            Configuration *at) {
    double wrench[6], force[MOST_SECTORS];
    int status = forward(k, theta, at);
    if (!status) status = in_domain(k, at);
    if (status) return status;
    if (beyond_loads(k, load)) return BEYOND_LOADS;
    memcpy(wrench, load, sizeof wrench);
    if (on_platform) turned(at->bodies[PLATFORM], load, wrench);
    for (int i = 0; i < 6; i++) wrench[i] = wrench[i] * parts->load_scale + parts->load_added[i];
    return respond(parts, m, at, wrench, 0, 0, 0, closed, twist, force);
}
