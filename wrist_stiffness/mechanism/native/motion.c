/* Exponential and logarithm of one rigid motion (see rigid_motion.py). */
#include <math.h>

#include "wrist.h"

#define SMALL_ANGLE 1e-4
#define SERIES_ANGLE 0.02
#define COSINE_OF_LARGE_ANGLE (-0.5)

void exp_twist(const double twist[6], double rotation[9], double shift[3]) {
    const double *v = twist, *w = twist + 3;
    const double square = dot3(w, w), angle = sqrt(square);
    double sine, first, second, wv[3], wwv[3];
    if (angle < SMALL_ANGLE) {
        sine = 1.0 - square / 6.0;
        first = 1.0 - square / 24.0;
    } else {
        sine = sin(angle) / angle;
        first = sin(0.5 * angle) / (0.5 * angle);
    }
    first = 0.5 * first * first;
    if (angle < SERIES_ANGLE)
        second = 1.0 / 6.0 - square / 120.0 + square * square / 5040.0;
    else
        second = (angle - sin(angle)) / (angle * square);
    cross3(w, v, wv);
    cross3(w, wv, wwv);
    for (int i = 0; i < 3; i++) shift[i] = v[i] + first * wv[i] + second * wwv[i];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            rotation[3 * i + j] = i == j ? 1.0 - first * (square - w[i] * w[i]) : first * w[i] * w[j];
    rotation[1] -= sine * w[2];
    rotation[2] += sine * w[1];
    rotation[3] += sine * w[2];
    rotation[5] -= sine * w[0];
    rotation[6] -= sine * w[1];
    rotation[7] += sine * w[0];
}

int log_motion(const double rotation[9], const double shift[3], double twist[6]) {
    const double *r = rotation;
    const double cosine = 0.5 * (r[0] + r[4] + r[8] - 1.0);
    if (!(cosine >= COSINE_OF_LARGE_ANGLE)) return RARE;
    double w[3] = {r[7] - r[5], r[2] - r[6], r[3] - r[1]}, wv[3], wwv[3];
    const double sine = 0.5 * sqrt(dot3(w, w));
    const double scale = sine > 0.0 ? 0.5 * atan2(sine, cosine) / sine : 0.5;
    for (int i = 0; i < 3; i++) twist[3 + i] = w[i] *= scale;
    const double square = dot3(w, w), angle = sqrt(square);
    const double third = angle < SMALL_ANGLE ? 1.0 / 12.0 + square / 720.0
                                             : (1.0 - 0.5 * angle / tan(0.5 * angle)) / square;
    cross3(w, shift, wv);
    cross3(w, wv, wwv);
    for (int i = 0; i < 3; i++) twist[i] = shift[i] - 0.5 * wv[i] + third * wwv[i];
    return OK;
}

void pose_of_twist(const double twist[6], double pose[7]) {
    double rotation[9];
    exp_twist(twist, rotation, pose);
    const double half = 0.5 * sqrt(dot3(twist + 3, twist + 3));
    const double scale = half > 0.0 ? 0.5 * sin(half) / half : 0.5;
    for (int i = 0; i < 3; i++) pose[3 + i] = scale * twist[3 + i];
    pose[6] = cos(half);
}
