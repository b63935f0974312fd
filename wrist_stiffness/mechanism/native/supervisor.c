/* What of a load is a payload, for one command after the other: `judge` and `share` of
 * `compensation/supervisor.py`, with `belief.py` and `payload.py`; to the bit. */
#include "wrist.h"

enum { UNSURE, FREE, HOLDING, IN_CONTACT, RELEASED, FOLLOWED };
enum { NO_TEXT, NO_LOAD, NEW_WEIGHT, NO_WEIGHT, TOUCHED_HERE };

typedef struct {
    double force, moment;
} Thresholds;

static double larger(double a, double b) { return b > a ? b : a; }
static double smaller(double a, double b) { return b < a ? b : a; }
static double length2(double a, double b) { return sqrt(a * a + b * b); }
static double length3(const double *a) { return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); }
static double apart(const double *a, const double *b) {
    return larger(fabs(a[0] - b[0]), fabs(a[1] - b[1]));
}
static int unknown(const Belief *s) { return s->state == UNSURE || s->state == IN_CONTACT; }

static Thresholds times(Thresholds limit, double factor) {
    return (Thresholds){factor * limit.force, factor * limit.moment};
}
static double size(const Reading *load, Thresholds limit) {
    const double force = length2(load->side, load->weight) / limit.force;
    return larger(force, length3(load->moments) / limit.moment);
}
static double aside(const Reading *load, Thresholds limit) {
    return larger(load->side / limit.force, fabs(load->moments[2]) / limit.moment);
}
static int is_weight(const Reading *load, Thresholds limit) {
    return aside(load, limit) <= 1.0 && load->weight > limit.force;
}

static double quadratic(const double spread[6], const double row[3]) {
    const double a = row[0], b = row[1], c = row[2];
    return a * a * spread[0] + b * b * spread[3] + c * c * spread[5] +
           2.0 * (a * b * spread[1] + a * c * spread[2] + b * c * spread[4]);
}

static Reading rest_of(const Estimate *payload, const Reading *load) {
    Reading rest = *load;
    rest.weight = load->weight - payload->weight;
    for (int i = 0; i < 2; i++) rest.moments[i] = load->moments[i] - dot3(load->rows[i], payload->moments);
    return rest;
}

static void learn(Estimate *payload, const double row[3], double value, double noise) {
    double *s = payload->spread, *m = payload->moments;
    const double a = row[0], b = row[1], c = row[2];
    const double px = s[0] * a + s[1] * b + s[2] * c, py = s[1] * a + s[3] * b + s[4] * c;
    const double pz = s[2] * a + s[4] * b + s[5] * c;
    const double gain = 1.0 / ((a * px + b * py + c * pz) + noise);
    const double step = gain * (value - a * m[0] - b * m[1] - c * m[2]);
    m[0] = m[0] + px * step;
    m[1] = m[1] + py * step;
    m[2] = m[2] + pz * step;
    s[0] = s[0] - gain * px * px;
    s[1] = s[1] - gain * px * py;
    s[2] = s[2] - gain * px * pz;
    s[3] = s[3] - gain * py * py;
    s[4] = s[4] - gain * py * pz;
    s[5] = s[5] - gain * pz * pz;
}

static int explains(const Rules *r, Estimate *payload, const Reading *load, Thresholds limit,
                    double counts) {
    const double force = load->weight - payload->weight;
    if (load->side * load->side + force * force > limit.force * limit.force) return 0;
    const Reading rest = rest_of(payload, load);
    const double *left = rest.moments;
    const double noise = limit.moment * limit.moment / (r->sigmas * r->sigmas);
    const double of[2] = {quadratic(payload->spread, load->rows[0]),
                          quadratic(payload->spread, load->rows[1])};
    const double moment = left[0] * left[0] / (noise + of[0]) + left[1] * left[1] / (noise + of[1]);
    if (moment + left[2] * left[2] / noise > r->sigmas * r->sigmas) return 0;
    if (counts == 0.0) return 1;
    if (payload->readings < r->enough) {
        payload->readings += counts;
        payload->weight += counts * force / payload->readings;
    }
    for (int i = 0; i < 2; i++)
        if (r->enough * of[i] > noise)
            learn(payload, load->rows[i], load->moments[i], noise / counts);
    return 1;
}

static void drop_payload(Belief *s) {
    s->payload.known = 0.0;
    s->weight = 1.0;
}

static void enter(const Rules *r, Belief *s, int state, int64_t at_ns[2]) {
    if (state == UNSURE || state == RELEASED) drop_payload(s);
    if (state == RELEASED) s->expected.known = 0.0;
    if (state != IN_CONTACT) {
        s->sure = state != UNSURE;
    } else if (s->payload.known && s->rest_s > r->late_s) {
        drop_payload(s);
        s->sure = 0.0;
    }
    s->candidate.known = 0.0;
    s->state = state;
    at_ns[1] = at_ns[0];
    s->text = state == UNSURE ? NEW_WEIGHT : state == IN_CONTACT ? NO_WEIGHT : NO_TEXT;
}

static int seeming(const Rules *r, Belief *s, const Reading *load, Thresholds limit) {
    s->is_against = 0.0;
    s->departure = 1.0;
    if (s->payload.known && explains(r, &s->payload, load, limit, s->counts)) return HOLDING;
    const int nothing = size(load, limit) <= 1.0;
    if (nothing && !s->payload.known) return FREE;
    const Reading rest = s->payload.known ? rest_of(&s->payload, load) : *load;
    if (nothing || !unknown(s)) s->departure = larger(1.0, size(&rest, limit));
    else if (s->state == UNSURE) s->departure = larger(1.0, aside(load, limit));
    if (nothing) return RELEASED;
    if (is_weight(load, limit) && s->weight == 1.0) return UNSURE;
    s->is_against = 1.0;
    for (int i = 0; i < 3; i++) s->against[i] = rest.moments[i];
    return IN_CONTACT;
}

static void look(const Rules *r, Belief *s, const Reading *load, Thresholds limit, int64_t at_ns[2]) {
    const int seen = seeming(r, s, load, s->state == IN_CONTACT ? times(limit, r->calm) : limit);
    s->seen_s = seen == s->seen ? s->seen_s + s->step_s * s->departure : 0.0;
    s->seen = seen;
    double patience = seen == FREE || seen == HOLDING ? r->settle_s : r->judge_s;
    if (s->weight < 1.0 && seen != HOLDING) patience = 0.0;
    if (seen != s->state && s->seen_s >= patience) enter(r, s, seen, at_ns);
}

static int stands(const Rules *r, const Estimate *payload, const Reading *load, Thresholds limit) {
    const double widest = larger(quadratic(payload->spread, load->rows[0]),
                                 quadratic(payload->spread, load->rows[1]));
    const Reading rest = rest_of(payload, load);
    return r->sigmas * sqrt(widest) <= r->open * limit.moment && size(&rest, limit) < size(load, limit);
}

static void feel(const Rules *r, Belief *s, const double theta[2], const Reading *load,
                 Thresholds limit) {
    if (s->share < 1.0 || s->weight < 1.0) {
        s->yielded = 1.0;
        for (int i = 0; i < 2; i++) s->place[i] = theta[i];
    }
    if (s->state != IN_CONTACT || !s->payload.known) return;
    if (s->weight < 1.0) {
        drop_payload(s);
        s->text = TOUCHED_HERE;
    } else if (!stands(r, &s->payload, load, limit)) {
        s->payload.known = 0.0;
    }
    s->sure = s->payload.known;
}

static void weigh(const Rules *r, Belief *s, const Reading *load, Thresholds limit, int64_t at_ns[2]) {
    if (!s->candidate.known || !explains(r, &s->candidate, load, limit, s->counts)) {
        const double variance = r->most_moment * r->most_moment;
        s->candidate = (Estimate){1.0, load->weight, {0.0, 0.0, 0.0}, variance ? 0.0 : r->enough,
                                  {variance, 0.0, 0.0, variance, 0.0, variance}};
        s->candidate_s = 0.0;
    }
    s->candidate_s += s->step_s;
    if (s->candidate_s < r->settle_s) return;
    Estimate expected = s->expected;
    const int agrees = expected.known && explains(r, &expected, load, limit, s->counts);
    if (s->yielded) {
        s->text = TOUCHED_HERE;
    } else if (!is_weight(load, times(limit, r->calm))) {
        s->text = NO_WEIGHT;
    } else {
        if (!agrees) s->expected.known = s->told = 0.0;
        s->payload = agrees ? expected : s->candidate;
        s->weight = 0.0;
        enter(r, s, HOLDING, at_ns);
    }
}

void begin_judging(const Rules *r, Belief *s, int64_t stamp_ns, int64_t at_ns[2]) {
    const int64_t last_ns = at_ns[0] ? at_ns[0] : stamp_ns;
    at_ns[0] = stamp_ns;
    s->step_s = stamp_ns > last_ns ? smaller((double)(stamp_ns - last_ns) / 1e9, r->longest_step_s) : 0.0;
    s->trust = r->trust;
    if (!r->follow) return;
    s->state = FOLLOWED;
    s->is_against = 0.0;
    s->sure = 1.0;
}

void judge(const Rules *r, const Scales *scales, Belief *s, const double theta[2],
           const Reading *load, int64_t at_ns[2], double wrench[6]) {
    if (s->yielded && apart(theta, s->place) > r->reach) s->yielded = 0.0;
    s->rest_s += s->step_s;
    if (!s->stands || apart(theta, s->stand) > r->encoder_step) {
        s->stands = 1.0;
        s->rest_s = 0.0;
        for (int i = 0; i < 2; i++) s->stand[i] = theta[i];
    }
    const double part = s->step_s / (r->late_s + s->step_s);
    for (int i = 0; i < 2; i++) {
        const double before = s->moves ? s->behind[i] : theta[i];
        s->behind[i] = before + part * (theta[i] - before);
    }
    s->moves = 1.0;
    const double turn = apart(theta, s->behind);
    const Thresholds limit = {r->force + turn * length2(load->side, load->weight),
                              r->moment + turn * length3(load->moments)};
    s->counts = s->step_s / r->late_s * r->moment / limit.moment;
    look(r, s, load, limit, at_ns);
    if (s->seen == IN_CONTACT) feel(r, s, theta, load, limit);
    else if (s->seen == UNSURE && s->state == UNSURE) weigh(r, s, load, limit, at_ns);
    else if (s->seen == HOLDING && s->state == HOLDING)
        s->weight = smaller(1.0, s->weight + s->step_s / r->ramp_s);
    for (int i = 0; i < 6; i++) wrench[i] = 0.0;
    if (!s->payload.known) return;
    const double weight = s->weight * s->payload.weight;
    const double first = s->weight * dot3(load->rows[0], s->payload.moments);
    const double second = s->weight * dot3(load->rows[1], s->payload.moments);
    for (int i = 0; i < 3; i++) {
        wrench[i] = weight * scales->axes[2][i];
        wrench[3 + i] = scales->axes[0][i] * first + scales->axes[1][i] * second;
    }
}

double share_of(const Rules *r, const Scales *scales, Belief *s, const double jacobian[6],
                const double delta[2]) {
    double turn[3], along[3];
    for (int i = 0; i < 3; i++) turn[i] = jacobian[2 * i] * delta[0] + jacobian[2 * i + 1] * delta[1];
    apply(scales->axes[0], turn, along);
    if (s->is_against && dot3(s->against, along) < 0.0)
        s->share = larger(0.0, s->share - s->step_s / r->yield_s);
    else if (!s->sure)
        s->share = larger(0.0, s->share - s->step_s / r->ramp_s);
    else if (!s->is_against && !s->yielded)
        s->share = smaller(1.0, s->share + s->step_s / r->ramp_s);
    return s->trust * s->share;
}

int holds_in_full(const Belief *s) { return !unknown(s) && s->share == 1.0 && s->weight == 1.0; }
