/* One-sided contact of the flanges by block principal pivoting (see contact.py). */
#include <math.h>

#include "wrist.h"

#define RELATIVE_TOLERANCE 1e-12
#define PATIENCE 5
#define MAX_PIVOTS 5000

/* A[i][j] = own approach + half_i . slide_j + slide_i . half_j; own is zero between joints. */
static double flexibility(const Sector *s, const double (*half)[3], const double *own, int m, int i,
                          int j) {
    const double through = dot3(half[i], s[j].slide) + dot3(s[i].slide, half[j]);
    return s[i].group == s[j].group ? own[i * m + j] + through : through;
}

/* Solve for the forces that close the given sectors, of either sign, by a Cholesky factor. */
static int held_force(const Sector *s, const double (*half)[3], const double *own, int m,
                      const double *gap, const int *places, int count, double *force) {
    double factor[MOST_SECTORS * (MOST_SECTORS + 1) / 2], x[MOST_SECTORS];
    double *row = factor;
    for (int i = 0; i < count; row += ++i) {
        const double *other = factor;
        double rest = -gap[places[i]];
        for (int j = 0; j <= i; other += ++j) {
            double sum = flexibility(s, half, own, m, places[i], places[j]);
            for (int l = 0; l < j; l++) sum -= row[l] * other[l];
            if (j < i)
                row[j] = sum * other[j]; /* the diagonal holds inverses */
            else if (sum > 0.0)
                row[i] = 1.0 / sqrt(sum);
            else
                return NOT_DEFINITE;
        }
        for (int l = 0; l < i; l++) rest -= row[l] * x[l];
        x[i] = rest * row[i];
    }
    for (int i = count - 1; i >= 0; i--) {
        row = factor + i * (i + 1) / 2;
        x[i] *= row[i];
        for (int l = 0; l < i; l++) x[l] -= row[l] * x[i];
    }
    for (int i = 0; i < count; i++) force[places[i]] = x[i];
    return OK;
}

int settle(const Parts *parts, int m, const double (*half)[3], const double *gap,
           unsigned char *closed, double *force) {
    const Sector *s = sectors_of(parts);
    const double *own = approach_of(parts, m);
    double least = 0.0, most = 0.0, largest = 0.0;
    int guessed = 0, places[MOST_SECTORS], wrong[MOST_SECTORS];
    for (int i = 0; i < m; i++) {
        if (!isfinite(gap[i])) return UNSETTLED;
        least = fmin(least, gap[i]);
        most = fmax(most, gap[i]);
        largest = fmax(largest, flexibility(s, half, own, m, i, i));
        guessed |= closed[i];
        force[i] = 0.0;
    }
    if (least >= 0.0) {
        for (int i = 0; i < m; i++) closed[i] = 0;
        return OK;
    }
    if (!guessed)
        for (int i = 0; i < m; i++) closed[i] = gap[i] < 0.0;
    const double least_opening = -RELATIVE_TOLERANCE * fmax(most, -least);
    const double least_force = least_opening / largest;
    int fewest = m + 1, patience = PATIENCE;
    for (int pivot = 0; pivot < MAX_PIVOTS; pivot++) {
        int count = 0, wrongs = 0;
        for (int i = 0; i < m; i++) {
            force[i] = 0.0;
            if (closed[i]) places[count++] = i;
        }
        const int status = held_force(s, half, own, m, gap, places, count, force);
        if (status) return status;
        double slid[3] = {0.0, 0.0, 0.0}, bent[3] = {0.0, 0.0, 0.0};
        for (int j = 0; j < count; j++)
            for (int l = 0; l < 3; l++) {
                slid[l] += force[places[j]] * s[places[j]].slide[l];
                bent[l] += force[places[j]] * half[places[j]][l];
            }
        for (int i = 0; i < m; i++) {
            if (closed[i]) {
                if (force[i] < least_force) wrong[wrongs++] = i;
                continue;
            }
            double opening = gap[i] + dot3(half[i], slid) + dot3(s[i].slide, bent);
            for (int j = 0; j < count; j++)
                if (s[places[j]].group == s[i].group)
                    opening += own[i * m + places[j]] * force[places[j]];
            if (opening < least_opening) wrong[wrongs++] = i;
        }
        if (!wrongs) {
            for (int i = 0; i < m; i++) force[i] = fmax(force[i], 0.0);
            return OK;
        }
        int first = 0;
        if (wrongs < fewest) {
            fewest = wrongs;
            patience = PATIENCE;
        } else if (patience > 0) {
            patience--;
        } else {
            first = wrongs - 1; /* one change at a time always ends */
        }
        for (int i = first; i < wrongs; i++) closed[wrong[i]] ^= 1;
    }
    return UNSETTLED;
}
