/* One wrist at one pose: what the NumPy formulas of this folder say, compiled.
 *
 * The judges are `kinematics.py`, `statics.py`, `contact.py`, `rigid_motion.py` and
 * `compensation/correction.py`, `scales.py` and `supervisor.py`; tests hold both equal to 1e-12.  All
 * matrices lie row by row; SI units; F and O as in docs/conventions.md.
 */
#ifndef WRIST_H
#define WRIST_H

#include <math.h>
#include <stdint.h>

enum { BODY_COUNT = 5, GROUPS = 5, MOST_SECTORS = 192 };
enum { FRAME, LINK_1, LINK_2, PLATFORM, LINK_3 };

/* Anything but OK: the caller asks the NumPy formulas, which say why. */
enum { OK, UNREACHABLE, OUTSIDE, SINGULAR, BEYOND_LOADS, NOT_DEFINITE, UNSETTLED, RARE,
       NO_FIXED_POINT, TOO_LARGE };

typedef struct {
    double turn[24][5];   /* by 1, cos 1, sin 1, cos 2, sin 2: both turns transposed, then b, d */
    double home_inverse[2][9];
    double axes[2][3];    /* a1, a2 */
    double cosines[2], assembly_mode, gram_rounding;
    double edges[2][2];   /* lower and upper angle of each motor in the table's domain */
    double least_singularity, most_force, most_moment;
} Mechanism;

typedef struct {
    double theta[2], b[3], c[3], d[3], singularity, dual[9], bodies[BODY_COUNT][9];
} Configuration;

typedef struct {
    double group, slide[3], screw[6], weight_gap[3], gap;
} Sector;

/* Followed by the sectors and their (m, m) approach. */
typedef struct {
    double gravity[3];
    double load_scale, load_added[6];
    double flexibility[GROUPS][36], weight_screw[GROUPS][18], constant_screw[GROUPS][6];
    double weight[BODY_COUNT][18];
} Parts;

typedef struct {
    double tolerance, unchecked, answers, dependent, most_iterations; /* of the search */
    double by_point;      /* 0: pointing, 1: orientation, 2: tool point */
    double vector[3];     /* platform normal or tool point in U */
    double play, limit;
} Task;

typedef struct {
    double slew, longest_step;               /* of the applied correction */
    double domain_fade, singularity_fade;    /* within these of a border it fades */
    double joints[2][2];                     /* lowest and highest angle of each motor */
} Safety;

#define NEVER INT64_MIN /* no command before */

typedef struct {
    double delta[2], after[6], twist[6], jacobian[6];
    Configuration at;
} Corrected;

/* What a load says of a payload, along two axes across gravity and down (see scales.py). */
typedef struct {
    double axes[3][3], gravity;
} Scales;

typedef struct {
    double side, weight, moments[3], rows[2][3];
} Reading;

/* A payload as far as it is known: weight, moments of its centre, their covariance xx xy xz yy yz zz. */
typedef struct {
    double known, weight, moments[3], readings, spread[6];
} Estimate;

/* The constants of compensation/supervisor.py and the settings. */
typedef struct {
    double judge_s, settle_s, late_s, longest_step_s, ramp_s, yield_s, calm, open, sigmas, enough;
    double follow, trust, force, moment, reach, encoder_step, most_moment;
} Rules;

/* What is believed of the load; whether something is there comes before it. */
typedef struct {
    double state, seen, text, told;
    double seen_s, step_s, candidate_s, rest_s, counts, weight, departure, trust;
    double share, sure, is_against, against[3], yielded, place[2];
    double moves, behind[2], stands, stand[2];
    Estimate payload, candidate, expected;
    double judged;        /* whether the command at which the loop ended was judged */
} Belief;

typedef struct {
    Rules rules;
    Scales scales;
    Belief belief;
} Supervisor;

void exp_twist(const double twist[6], double rotation[9], double shift[3]);
int log_motion(const double rotation[9], const double shift[3], double twist[6]);
void pose_of_twist(const double twist[6], double pose[7]);

int forward(const Mechanism *k, const double theta[2], Configuration *at);
int in_domain(const Mechanism *k, const Configuration *at);
void table_covariance(const Mechanism *k, const Configuration *at, const double twist[6],
                      double of_size, double of_step, double covariance[36]);
void jacobian_of(const Mechanism *k, const Configuration *at, double jacobian[6]);

int respond(const Parts *parts, int m, const Configuration *at, const double wrench[6],
            const double *limb_1, const double *limb_2, const double *opening,
            unsigned char *closed, double twist[6], double *force);
int predict(const Mechanism *k, const Parts *parts, int m, const double theta[2],
            const double load[6], int on_platform, unsigned char *closed, double twist[6],
            Configuration *at);

int read_load(const Mechanism *k, const Scales *scales, const Configuration *at,
              const double load[6], int on_platform, Reading *out);
void begin_judging(const Rules *r, Belief *s, int64_t stamp_ns, int64_t at_ns[2]);
void judge(const Rules *r, const Scales *scales, Belief *s, const double theta[2],
           const Reading *load, int64_t at_ns[2], double wrench[6]);
double share_of(const Rules *r, const Scales *scales, Belief *s, const double jacobian[6],
                const double delta[2]);
int holds_in_full(const Belief *s);

int correct(const Mechanism *k, const Parts *parts, int m, const Task *task,
            const Configuration *desired, const double load[6], int on_platform,
            const double held[2], unsigned char *closed, Corrected *out);

void apply_safely(const Mechanism *k, const Safety *safety, const double command[2], int64_t stamp_ns,
                  double share, Corrected *found, double applied[2], int64_t *last_ns);

int settle(const Parts *parts, int m, const double (*half)[3], const double *gap,
           unsigned char *closed, double *force);

/* The same of a flexibility (m, m); and the forces that close the given sectors, of either sign, for
 * openings (columns, m), which leave the others alone. */
int settle_matrix(const double *a, int m, const double *gap, unsigned char *closed, double *force);
int hold_matrix(const double *a, int m, int columns, const double *gap,
                const unsigned char *closed, double *force);

/* `axes` (n, 2, 2): principal ones by columns, or null; `feet` (n + 1, 2): the first one is given. */
void slip(long n, const double *moved, const double *compliance, const double *axes,
          const double *budget, double *force, double *feet);

static inline double dot3(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline void cross3(const double *a, const double *b, double *out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}
/* out = M v, and out = M' v */
static inline void apply(const double *m, const double *v, double *out) {
    for (int i = 0; i < 3; i++) out[i] = dot3(m + 3 * i, v);
}
static inline void apply_back(const double *m, const double *v, double *out) {
    for (int i = 0; i < 3; i++) out[i] = m[i] * v[0] + m[i + 3] * v[1] + m[i + 6] * v[2];
}
static inline int beyond_loads(const Mechanism *k, const double *load) {
    return !(sqrt(dot3(load, load)) <= k->most_force &&
             sqrt(dot3(load + 3, load + 3)) <= k->most_moment);
}
static inline const Sector *sectors_of(const Parts *parts) { return (const Sector *)(parts + 1); }
static inline const double *approach_of(const Parts *parts, int m) {
    return (const double *)(sectors_of(parts) + m);
}

#endif
