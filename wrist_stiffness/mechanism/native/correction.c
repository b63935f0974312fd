/* The motor angles that make the task right: `compensation/correction.py` for one command. */
#include <math.h>
#include <string.h>

#include "wrist.h"

enum { POINTING, ORIENTATION, TOOL_POINT };

/* (2, n) pseudo-inverse of two columns (3, 2). */
static int pseudo_inverse(const double columns[6], double dependent, double out[6]) {
    double first = 0.0, product = 0.0, second = 0.0;
    for (int i = 0; i < 3; i++) {
        first += columns[2 * i] * columns[2 * i];
        product += columns[2 * i] * columns[2 * i + 1];
        second += columns[2 * i + 1] * columns[2 * i + 1];
    }
    const double determinant = first * second - product * product;
    const double least = dependent * fmax(first, second);
    if (!(determinant > least * least)) return RARE;
    for (int i = 0; i < 3; i++) {
        const double a = columns[2 * i], b = columns[2 * i + 1];
        out[i] = (second * a - product * b) / determinant;
        out[3 + i] = (first * b - product * a) / determinant;
    }
    return OK;
}

/* From a residual twist to the motor angles that cancel its task part, (2, 6). */
static int cancelling(const Task *task, const Configuration *at, const double jacobian[6],
                      double out[12]) {
    double columns[6], inverse[6], axis[3];
    memcpy(columns, jacobian, sizeof columns);
    memset(out, 0, 12 * sizeof *out);
    apply(at->bodies[PLATFORM], task->vector, axis);
    for (int motor = 0; motor < 2; motor++) {
        double turn[3] = {jacobian[motor], jacobian[2 + motor], jacobian[4 + motor]}, moved[3];
        if (task->by_point == TOOL_POINT)
            cross3(turn, axis, moved);
        else
            for (int i = 0; i < 3; i++)
                moved[i] = task->by_point == POINTING ? turn[i] - axis[i] * dot3(axis, turn) : turn[i];
        for (int i = 0; i < 3; i++) columns[2 * i + motor] = moved[i];
    }
    if (pseudo_inverse(columns, task->dependent, inverse)) return RARE;
    for (int motor = 0; motor < 2; motor++) {
        const double *row = inverse + 3 * motor;
        if (task->by_point == TOOL_POINT) {
            memcpy(out + 6 * motor, row, 3 * sizeof *row);
            cross3(axis, row, out + 6 * motor + 3);
        } else {
            memcpy(out + 6 * motor + 3, row, 3 * sizeof *row);
        }
    }
    return OK;
}

/* log(T_err T_nominal T_desired^-1) */
static int residual_twist(const double twist[6], const double *platform, const double *desired,
                          double after[6]) {
    double error[9], shift[3], apart[9], rotation[9];
    exp_twist(twist, error, shift);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) apart[3 * i + j] = dot3(platform + 3 * i, desired + 3 * j);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            rotation[3 * i + j] = error[3 * i] * apart[j] + error[3 * i + 1] * apart[3 + j] +
                                  error[3 * i + 2] * apart[6 + j];
    return log_motion(rotation, shift, after);
}

static double next_step(const Task *task, double missing, double last_missing, double last_step) {
    const double beyond = missing - fmin(fmax(missing, -task->play), task->play);
    if (beyond != 0.0 && fabs(missing - last_missing) < task->answers * fabs(last_step))
        return -copysign(fmax(fabs(missing), 2.0 * fabs(last_step)), missing);
    return -beyond;
}

int correct(const Mechanism *k, const Parts *parts, int m, const Task *task,
            const Configuration *desired, const double load[6], int on_platform,
            const double held[2], unsigned char *closed, Corrected *out) {
    const double *command = desired->theta;
    double cancel[12], steps[2] = {0.0, 0.0}, missing[2] = {0.0, 0.0}, size = INFINITY;
    int status;
    jacobian_of(k, desired, out->jacobian);
    if (cancelling(task, desired, out->jacobian, cancel)) return RARE;
    memcpy(out->delta, held, sizeof out->delta);
    for (int iteration = 0; iteration <= task->most_iterations; iteration++) {
        const double theta[2] = {command[0] + out->delta[0], command[1] + out->delta[1]};
        status = predict(k, parts, m, theta, load, on_platform, closed, out->twist, &out->at);
        if (!status)
            status = residual_twist(out->twist, out->at.bodies[PLATFORM],
                                    desired->bodies[PLATFORM], out->after);
        if (status) return status;
        if (iteration == task->most_iterations) break;
        const double last = size;
        size = 0.0;
        for (int motor = 0; motor < 2; motor++) {
            const double *row = cancel + 6 * motor, last_missing = missing[motor];
            missing[motor] = dot3(row, out->after) + dot3(row + 3, out->after + 3);
            steps[motor] = next_step(task, missing[motor], last_missing, steps[motor]);
            size = fmax(size, fabs(steps[motor]));
        }
        if (!isfinite(size)) return NO_FIXED_POINT;
        const int there = size < task->tolerance;
        /* The steps shrink by a constant factor, so the last two of them bound what is missing. */
        const int shrinking =
            size < last && last < INFINITY && size * size < task->tolerance * (last - size);
        for (int motor = 0; motor < 2 && !there; motor++) out->delta[motor] += steps[motor];
        if (there || shrinking || size < task->unchecked * task->play) {
            for (int i = 0; i < 3 && !there; i++)
                out->after[3 + i] +=
                    out->jacobian[2 * i] * steps[0] + out->jacobian[2 * i + 1] * steps[1];
            const int large = fmax(fabs(out->delta[0]), fabs(out->delta[1])) > task->limit;
            return large ? TOO_LARGE : OK;
        }
    }
    return NO_FIXED_POINT;
}

/* How a share of a correction reaches the motors (see compensation/safety.py); without one what was
 * applied goes back to nothing. */
void apply_safely(const Mechanism *k, const Safety *safety, const double command[2],
                  int64_t stamp_ns, double share, Corrected *found, double applied[2], int64_t *last_ns) {
    double wanted[2] = {0.0, 0.0}, seconds = 0.0;
    if (found) {
        double weight = (fabs(found->at.singularity) - k->least_singularity) / safety->singularity_fade;
        for (int i = 0; i < 2; i++) {
            const double angle = found->at.theta[i];
            const double to_border = fmin(angle - k->edges[i][0], k->edges[i][1] - angle);
            weight = fmin(weight, to_border / safety->domain_fade);
        }
        weight = fmin(fmax(weight, 0.0), 1.0);
        weight *= weight * (3.0 - 2.0 * weight);
        for (int i = 0; i < 2; i++) wanted[i] = share * weight * found->delta[i];
    }
    if (*last_ns != NEVER && stamp_ns > *last_ns)
        seconds = fmin((double)(stamp_ns - *last_ns) / 1e9, safety->longest_step);
    *last_ns = stamp_ns;
    const double reach = safety->slew * seconds;
    for (int i = 0; i < 2; i++) {
        const double *range = safety->joints[i], angle = command[i];
        const double sent = angle + (applied[i] + fmin(fmax(wanted[i] - applied[i], -reach), reach));
        applied[i] = fmin(fmax(sent, fmin(range[0], angle)), fmax(range[1], angle)) - angle;
    }
    if (!found) return;
    const double step[2] = {applied[0] - found->delta[0], applied[1] - found->delta[1]};
    for (int i = 0; i < 3; i++)
        found->after[3 + i] += found->jacobian[2 * i] * step[0] + found->jacobian[2 * i + 1] * step[1];
}
