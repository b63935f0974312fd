/* One-sided contact of the flanges by block principal pivoting (see contact.py). */
#include <math.h>

#include "wrist.h"

#define RELATIVE_TOLERANCE 1e-12
#define PATIENCE 5
#define MAX_PIVOTS 5000

/* The flexibility A[i][j] of a contact problem, and what forces on the closed sectors add to the
 * openings of the others. */
typedef double Flexibility(const void *of, int i, int j);
typedef void Opened(const void *of, int m, const int *places, int count, const double *force,
                    const unsigned char *closed, double *opening);

/* Cholesky factor of the flexibility of some sectors, row by row; the diagonal holds inverses. */
static inline int factored(const void *of, Flexibility *flexibility, const int *places, int count,
                           double *factor) {
    double *row = factor;
    for (int i = 0; i < count; row += ++i) {
        const double *other = factor;
        for (int j = 0; j <= i; other += ++j) {
            double sum = flexibility(of, places[i], places[j]);
            for (int l = 0; l < j; l++) sum -= row[l] * other[l];
            if (j < i)
                row[j] = sum * other[j];
            else if (sum > 0.0)
                row[i] = 1.0 / sqrt(sum);
            else
                return NOT_DEFINITE;
        }
    }
    return OK;
}

/* The forces that close these sectors, of either sign; only their places are written. */
static inline void closing(const double *factor, const int *places, int count, const double *gap,
                           double *force) {
    double x[MOST_SECTORS];
    const double *row = factor;
    for (int i = 0; i < count; row += ++i) {
        double rest = -gap[places[i]];
        for (int l = 0; l < i; l++) rest -= row[l] * x[l];
        x[i] = rest * row[i];
    }
    for (int i = count - 1; i >= 0; i--) {
        row = factor + i * (i + 1) / 2;
        x[i] *= row[i];
        for (int l = 0; l < i; l++) x[l] -= row[l] * x[i];
    }
    for (int i = 0; i < count; i++) force[places[i]] = x[i];
}

static inline int settled(const void *of, Flexibility *flexibility, Opened *opened, int m,
                          const double *gap, unsigned char *closed, double *force) {
    double least = 0.0, most = 0.0, largest = 0.0;
    double factor[MOST_SECTORS * (MOST_SECTORS + 1) / 2], opening[MOST_SECTORS];
    int guessed = 0, places[MOST_SECTORS], wrong[MOST_SECTORS];
    for (int i = 0; i < m; i++) {
        if (!isfinite(gap[i])) return UNSETTLED;
        least = fmin(least, gap[i]);
        most = fmax(most, gap[i]);
        largest = fmax(largest, flexibility(of, i, i));
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
            opening[i] = gap[i];
            if (closed[i]) places[count++] = i;
        }
        const int status = factored(of, flexibility, places, count, factor);
        if (status) return status;
        closing(factor, places, count, gap, force);
        opened(of, m, places, count, force, closed, opening);
        for (int i = 0; i < m; i++)
            if (closed[i] ? force[i] < least_force : opening[i] < least_opening)
                wrong[wrongs++] = i;
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

/* Of a wrist: A[i][j] = own approach + half_i . slide_j + slide_i . half_j; own is zero between
 * joints. */
typedef struct {
    const Sector *s;
    const double (*half)[3], *own;
    int m;
} Flanges;

static double through_flanges(const void *of, int i, int j) {
    const Flanges *f = of;
    const double through = dot3(f->half[i], f->s[j].slide) + dot3(f->s[i].slide, f->half[j]);
    return f->s[i].group == f->s[j].group ? f->own[i * f->m + j] + through : through;
}

static void opened_flanges(const void *of, int m, const int *places, int count,
                           const double *force, const unsigned char *closed, double *opening) {
    const Flanges *f = of;
    double slid[3] = {0.0, 0.0, 0.0}, bent[3] = {0.0, 0.0, 0.0};
    for (int j = 0; j < count; j++)
        for (int l = 0; l < 3; l++) {
            slid[l] += force[places[j]] * f->s[places[j]].slide[l];
            bent[l] += force[places[j]] * f->half[places[j]][l];
        }
    for (int i = 0; i < m; i++) {
        if (closed[i]) continue;
        opening[i] += dot3(f->half[i], slid) + dot3(f->s[i].slide, bent);
        for (int j = 0; j < count; j++)
            if (f->s[places[j]].group == f->s[i].group)
                opening[i] += f->own[i * m + places[j]] * force[places[j]];
    }
}

int settle(const Parts *parts, int m, const double (*half)[3], const double *gap,
           unsigned char *closed, double *force) {
    const Flanges own = {sectors_of(parts), half, approach_of(parts, m), m};
    return settled(&own, through_flanges, opened_flanges, m, gap, closed, force);
}

/* Of any matrix. */
typedef struct {
    const double *a;
    int m;
} Matrix;

static double of_matrix(const void *of, int i, int j) {
    const Matrix *matrix = of;
    return matrix->a[i * matrix->m + j];
}

static void opened_matrix(const void *of, int m, const int *places, int count,
                          const double *force, const unsigned char *closed, double *opening) {
    const double *row = ((const Matrix *)of)->a;
    for (int i = 0; i < m; i++, row += m)
        if (!closed[i])
            for (int j = 0; j < count; j++) opening[i] += row[places[j]] * force[places[j]];
}

int settle_matrix(const double *a, int m, const double *gap, unsigned char *closed, double *force) {
    const Matrix own = {a, m};
    return settled(&own, of_matrix, opened_matrix, m, gap, closed, force);
}

int hold_matrix(const double *a, int m, int columns, const double *gap,
                const unsigned char *closed, double *force) {
    const Matrix own = {a, m};
    double factor[MOST_SECTORS * (MOST_SECTORS + 1) / 2];
    int count = 0, places[MOST_SECTORS];
    for (int i = 0; i < m; i++)
        if (closed[i]) places[count++] = i;
    const int status = factored(&own, of_matrix, places, count, factor);
    if (!status)
        for (int t = 0; t < columns; t++, gap += m, force += m)
            closing(factor, places, count, gap, force);
    return status;
}
